"""From currents to joint torques for the arms of the presets: published drive numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tauguard.arrays import Array
from tauguard.traces.trace import Trace

REVERSAL = 0.02  # [rad/s] over which Coulomb friction changes its sign


@dataclass(frozen=True)
class DriveNumbers:
    """Gains and friction as a user knows them; one number a joint."""

    gain: tuple[float, ...]  #: N m of joint torque per ampere
    viscous: tuple[float, ...] = ()  #: N m s/rad, empty for none
    coulomb: tuple[float, ...] = ()  #: N m, empty for none

    def __post_init__(self) -> None:
        """Check lengths and values.

        Raises:
            ValueError: different lengths, a gain of 0, a number that is not finite or below 0.
        """
        for name in ("viscous", "coulomb"):
            values = getattr(self, name)
            if values and len(values) != len(self.gain):
                raise ValueError(f"{name}: {len(values)} numbers for {len(self.gain)} gains")
            if values and not (np.isfinite(values).all() and min(values) >= 0):
                raise ValueError(f"{name}: {values}, every number must be finite and not below 0")
        if not (self.gain and np.isfinite(self.gain).all() and 0 not in self.gain):
            raise ValueError(f"gain: {self.gain}, every number must be finite and not 0")

    def tau(self, current: Array, qd: Array) -> Array:
        """Torque at the joints less friction [N m], shape (T, n), from currents and speeds."""
        tau = current * np.asarray(self.gain)
        if self.viscous:
            tau = tau - qd * np.asarray(self.viscous)
        if self.coulomb:
            tau = tau - np.tanh(qd / REVERSAL) * np.asarray(self.coulomb)
        return np.asarray(tau, np.float64)


# Mamedov et al. 2020 (doi 10.3389/frobt.2020.571574), identified on one arm. Another source gives
# gains up to 50 % higher: scale your own if you can.
UR10E = DriveNumbers(
    gain=(10.0, 10.70, 8.46, 9.00, 9.48, 10.12),
    viscous=(21.3, 20.2, 10.4, 3.6, 2.5, 3.0),
    coulomb=(12.5, 13.3, 5.0, 2.0, 2.7, 2.3),
)
# The ratio of a UR5 controller's own target torques to its target currents, by least squares over
# its logs. The last joint's is not identifiable; it has the drive of the one before.
UR5 = DriveNumbers(gain=(12.0, 10.6, 11.1, 9.9, 10.3, 10.3))
DRIVES = {"ur10e": UR10E, "ur5": UR5}


def preset_drive(columns: str | None, logs: Sequence[Trace]) -> tuple[str, DriveNumbers] | None:
    """Name and drive of the preset that the logs' columns are of, or else of the one named.

    Raises:
        ValueError: logs of different presets, one of whose drives is known.
    """
    names = sorted({str(log.meta.get("columns") or columns or "no preset") for log in logs})
    if len(names) > 1 and not DRIVES.keys().isdisjoint(names):
        raise ValueError(f"logs of {', '.join(names)}: give those of one preset, or --gains")
    return (names[0], DRIVES[names[0]]) if names and names[0] in DRIVES else None
