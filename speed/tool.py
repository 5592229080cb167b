"""The part of the robot that touches: a tool with its contact area, and a soft cover."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tauguard.arrays import Array
from tauguard.findings import ArgumentError


@dataclass(frozen=True)
class Tool:
    """A tool at the flange, and the face with which it touches a person."""

    kind: str = "flat"  #: "flat", "sphere" or "edge"
    area_cm2: float = 1.0  #: contact area of a flat face or an edge [cm^2]
    radius: float = 0.0  #: of a sphere [m]
    mass: float = 0.5  #: with the part that it holds [kg]
    length: float = 0.1  #: from the flange to the contact point, along the flange's z axis [m]

    #: An edge or tip with a smaller area or radius is sharp: force limits do not apply to it.
    SMALLEST_AREA_CM2 = 0.1
    SMALLEST_RADIUS = 0.002  # [m]

    def __post_init__(self) -> None:
        """Check the values: ``ArgumentError`` says what is wrong."""
        if self.kind not in ("flat", "sphere", "edge"):
            raise ArgumentError(f"tool {self.kind!r}: expected flat, sphere or edge")
        if not (self.mass > 0 and np.isfinite(self.mass)):
            raise ArgumentError(f"tool: mass {self.mass} kg: expected above 0")
        if not 0 <= self.length <= 2:
            raise ArgumentError(f"tool: length {self.length} m: expected 0 to 2")
        sphere = self.kind == "sphere"
        least = self.SMALLEST_RADIUS if sphere else self.SMALLEST_AREA_CM2
        if not least <= (self.radius if sphere else self.area_cm2) < np.inf:
            raise ArgumentError(
                f"tool: {self}: sharp; force and pressure limits hold for blunt parts only: radius "
                f"from {1e3 * self.SMALLEST_RADIUS:g} mm, area from {self.SMALLEST_AREA_CM2:g} cm2"
            )

    @classmethod
    def parse(cls, text: str, mass: float = 0.5, length: float = 0.1) -> Tool:
        """The tool of a text: ``flat:CM2``, ``sphere:RADIUS_MM`` or ``edge:WIDTHxLENGTH`` in mm.

        Raises:
            ArgumentError: another text, or a sharp tool.
        """
        kind, _, size = text.partition(":")
        try:
            numbers = [float(word) for word in size.split("x")]
            if kind == "flat" and len(numbers) == 1:
                return cls("flat", numbers[0], mass=mass, length=length)
            if kind == "sphere" and len(numbers) == 1:
                return cls("sphere", radius=numbers[0] / 1e3, mass=mass, length=length)
            if kind == "edge" and len(numbers) == 2:
                return cls("edge", numbers[0] * numbers[1] / 100, mass=mass, length=length)
        except ArgumentError:
            raise
        except ValueError:
            pass
        raise ArgumentError(
            f"tool {text!r}: expected flat:AREA_CM2, sphere:RADIUS_MM or edge:WIDTHxLENGTH in mm, "
            "such as flat:1.0, sphere:30 or edge:2x20"
        )

    def __str__(self) -> str:
        if self.kind == "sphere":
            return f"sphere of radius {1e3 * self.radius:g} mm"
        return f"{self.kind} of {self.area_cm2:.3g} cm2"

    def pressure(self, force: Array, stiffness: Array) -> Array:
        """Largest pressure [N/cm^2] at a force [N] on tissue of a stiffness [N/m].

        A flat face has the mean pressure. A sphere sinks in by force / stiffness; the pressure in
        the middle of its circle of contact is 1.5 times the mean one (Hertz).
        """
        if self.kind != "sphere":
            return np.asarray(force / self.area_cm2)
        depth = np.minimum(force / stiffness, self.radius)
        area = 1e4 * np.pi * depth * (2 * self.radius - depth)
        return np.divide(1.5 * force, area, out=np.zeros_like(area), where=area > 0)


@dataclass(frozen=True)
class Cover:
    """A soft cover: a spring in series with the tissue until its thickness is used up."""

    stiffness: float  #: [N/m]
    thickness: float  #: by which it can be compressed [m]

    def __post_init__(self) -> None:
        """Check the values: ``ArgumentError`` says what is wrong."""
        if not (self.stiffness > 0 and self.thickness > 0):
            raise ArgumentError(
                f"cover: stiffness {self.stiffness} N/m, thickness {self.thickness} m: expected "
                "both above 0"
            )

    @classmethod
    def parse(cls, text: str) -> Cover:
        """The cover of a text ``STIFFNESS:THICKNESS`` in N/mm and mm, such as ``5:20``.

        Raises:
            ArgumentError: another text.
        """
        try:
            stiffness, thickness = (float(word) for word in text.split(":"))
        except ValueError:
            raise ArgumentError(
                f"cover {text!r}: expected STIFFNESS:THICKNESS in N/mm and mm, such as 5:20"
            ) from None
        return cls(1e3 * stiffness, thickness / 1e3)


@dataclass(frozen=True)
class Spring:
    """Contact force over penetration: the tissue's spring, with a cover in series if there is one.

    All arrays broadcast.
    """

    tissue: Array  #: stiffness of the body region [N/m]
    cover: Cover | None = None

    @property
    def _first(self) -> tuple[Array, Array, Array]:
        """Stiffness of the first stage [N/m], and penetration [m] and force [N] at its end."""
        if self.cover is None:
            return self.tissue, np.full_like(self.tissue, np.inf), np.full_like(self.tissue, np.inf)
        both = self.tissue * self.cover.stiffness / (self.tissue + self.cover.stiffness)
        force = np.full_like(both, self.cover.stiffness * self.cover.thickness)
        return both, force / both, force

    def force(self, penetration: Array) -> Array:
        """Force [N] at a penetration [m]; 0 where it is negative."""
        depth = np.maximum(penetration, 0.0)
        stiffness, end, full = self._first
        if self.cover is None:
            return np.asarray(stiffness * depth)
        beyond = depth - end
        return np.where(beyond > 0, full + self.tissue * beyond, stiffness * depth)

    def peak(self, energy: Array) -> Array:
        """Largest force [N] when the spring takes up an energy [J]."""
        stiffness, _, full = self._first
        force = np.sqrt(2 * stiffness * energy)
        if self.cover is None:
            return np.asarray(force)
        rest = np.maximum(energy - full**2 / (2 * stiffness), 0.0)
        return np.where(force > full, np.sqrt(full**2 + 2 * self.tissue * rest), force)

    def energy(self, force: Array) -> Array:
        """Energy [J] that the spring has taken up at a force [N]; inverse of :meth:`peak`."""
        stiffness, _, full = self._first
        if self.cover is None:
            return np.asarray(force**2 / (2 * stiffness))
        low = np.minimum(force, full)
        high = np.maximum(force, full)
        return np.asarray(low**2 / (2 * stiffness) + (high**2 - full**2) / (2 * self.tissue))
