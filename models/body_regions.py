"""Body regions of a person and their force limits (power and force limiting).

The numbers are those of the power-and-force-limiting annex of ISO 10218-2:2025, formerly ISO/TS
15066. Public copies contradict each other, so each value says whether an open source confirmed
it. Verify the others against the standard before you rely on them. Nothing here replaces the
risk assessment of a real workplace.
"""

import math
import tomllib
from dataclasses import dataclass, fields, replace
from pathlib import Path

from tauguard.findings import ArgumentError
from tauguard.untrusted_input import read_text, reading

#: Text to show beside a value that no open source confirmed.
UNCONFIRMED = "verify against the standard"


@dataclass(frozen=True)
class BodyRegion:
    """One region: its limits of force and pressure, its stiffness, and its effective mass."""

    name: str
    quasi_static_force: float  #: F_QS, limit of quasi-static contact (clamping) [N]
    stiffness: float  #: k, stiffness of the contact [N/m]
    mass: float  #: m_H, effective mass [kg]
    quasi_static_pressure: float  #: limit of quasi-static contact [N/cm^2]
    transient: bool = True  #: False: no transient contact is allowed (skull, face)
    unconfirmed: tuple[str, ...] = ()  #: fields to show with :data:`UNCONFIRMED`

    @property
    def transient_force(self) -> float:
        """F_T, largest force of an impact [N]: twice F_QS, and 0 where no impact is allowed."""
        return 2 * self.quasi_static_force if self.transient else 0.0

    @property
    def transient_pressure(self) -> float:
        """Largest pressure of an impact [N/cm^2]: twice the quasi-static one, or 0."""
        return 2 * self.quasi_static_pressure if self.transient else 0.0

    def peak_force(self, speed: float, robot_mass: float) -> float:
        """Peak force [N] of an impact in the standard's model of two masses and a spring.

        Args:
            speed: relative speed along the contact normal [m/s], 0 or more.
            robot_mass: effective mass of the robot at the contact [kg].

        Raises:
            ArgumentError: a negative speed, or a mass that is not above 0.
        """
        if not speed >= 0:
            raise ArgumentError(f"speed {speed} m/s: expected 0 or more, towards each other")
        return speed * math.sqrt(self._reduced_mass(robot_mass) * self.stiffness)

    def speed_limit(self, robot_mass: float) -> float:
        """Largest relative speed [m/s] at which an impact stays within :attr:`transient_force`."""
        return self.transient_force / math.sqrt(self._reduced_mass(robot_mass) * self.stiffness)

    def _reduced_mass(self, robot_mass: float) -> float:
        if not robot_mass > 0:
            raise ArgumentError(f"robot_mass {robot_mass} kg: expected above 0")
        if math.isinf(robot_mass):
            return self.mass
        return self.mass * robot_mass / (self.mass + robot_mass)


_FORCE, _STIFFNESS = ("quasi_static_force",), ("stiffness",)
# name, F_QS [N], k [N/mm], m_H [kg], p_QS [N/cm^2], unconfirmed fields besides m_H, which is never
# confirmed. The pressure is the lowest one of the region's measuring points (annex A, table A.2).
_TABLE: tuple[tuple[str, float, float, float, float, tuple[str, ...]], ...] = (
    ("skull", 130, 150, 4.4, 110, _FORCE),
    ("face", 65, 75, 4.4, 110, _FORCE),
    ("neck", 150, 50, 1.2, 140, _FORCE),
    ("back", 210, 35, 40, 160, ()),
    ("chest", 140, 25, 40, 120, ()),
    ("abdomen", 110, 10, 40, 140, ()),
    ("pelvis", 180, 25, 40, 210, _STIFFNESS),
    ("upper_arm", 150, 30, 3, 190, _STIFFNESS),
    ("lower_arm", 160, 40, 2, 180, _STIFFNESS),
    ("hand", 140, 75, 0.6, 190, _STIFFNESS),
    ("thigh", 220, 50, 75, 220, _FORCE + _STIFFNESS),
    ("lower_leg", 130, 60, 75, 210, _FORCE + _STIFFNESS),
)

#: The regions by name; ``back`` is back and shoulders.
BODY_REGIONS = {
    name: BodyRegion(
        name,
        float(force),
        1e3 * stiffness,
        float(mass),
        float(pressure),
        transient=name not in ("skull", "face"),
        unconfirmed=(*open_, "mass"),
    )
    for name, force, stiffness, mass, pressure, open_ in _TABLE
}


def read_regions(path: str | Path) -> dict[str, BodyRegion]:
    """Body regions with the limits of a TOML file; what the file does not state stays as it is.

    Args:
        path: a TOML file with a table for each region, for example
            ``[hand]`` with ``quasi_static_force = 120`` (fields of :class:`BodyRegion`).

    Raises:
        ArgumentError: an unknown region or field, or a number that is not above 0.
        FileError: the file is no TOML.
        OSError: the file is missing.
    """
    with reading(path, "expected TOML with a table for each body region"):
        tables = tomllib.loads(read_text(path))
    numbers = {f.name for f in fields(BodyRegion) if f.type is float}
    regions = dict(BODY_REGIONS)
    for name, table in tables.items():
        region = body_region(name)
        if not isinstance(table, dict) or not set(table) <= numbers | {"transient"}:
            raise ArgumentError(f"{path}: [{name}]: expected some of {', '.join(sorted(numbers))}")
        for key, value in table.items():
            if key in numbers and not (isinstance(value, int | float) and value > 0):
                raise ArgumentError(
                    f"{path}: [{name}] {key} = {value!r}: expected a number above 0"
                )
        regions[name] = replace(region, **table)
    return regions


def body_region(name: str) -> BodyRegion:
    """The region called ``name``.

    Raises:
        ArgumentError: no such region; the message lists them.
    """
    if name not in BODY_REGIONS:
        raise ArgumentError(f"body region {name!r}: expected one of {', '.join(BODY_REGIONS)}")
    return BODY_REGIONS[name]
