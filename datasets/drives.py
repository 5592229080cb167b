"""Drive gains (joint torque per motor current) of the arms of the column presets."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tauguard.traces.trace import Trace


@dataclass(frozen=True)
class DriveNumbers:
    """Drive gains of an arm, one number per joint."""

    gain: tuple[float, ...]  #: N m of joint torque per ampere

    def __post_init__(self) -> None:
        """Check: ``ValueError`` for no gains, a gain of 0, or one that is not finite."""
        if not (self.gain and np.isfinite(self.gain).all() and 0 not in self.gain):
            raise ValueError(f"gain: {self.gain}, every number must be finite and not 0")


# Mamedov et al. 2020 (doi 10.3389/frobt.2020.571574), identified on one arm. Another source gives
# gains up to 50 % higher: identify your own arm's gains if you can.
UR10E = DriveNumbers(gain=(10.0, 10.70, 8.46, 9.00, 9.48, 10.12))
# Ratio of the target torques to the target currents of a UR5's controller, by least squares over
# its logs. The last joint's gain is not identifiable; the last two joints have the same drive.
UR5 = DriveNumbers(gain=(12.0, 10.6, 11.1, 9.9, 10.3, 10.3))
DRIVES = {"ur10e": UR10E, "ur5": UR5}


def preset_drive(columns: str | None, logs: Sequence[Trace]) -> tuple[str, DriveNumbers] | None:
    """Name and drive of the preset of the logs' columns, else of ``columns``; None: not known.

    Raises:
        ValueError: the logs have columns of different presets, and the drive of one is known.
    """
    names = sorted({str(log.meta.get("columns") or columns or "no preset") for log in logs})
    if len(names) > 1 and not DRIVES.keys().isdisjoint(names):
        raise ValueError(
            f"logs of {', '.join(names)}, whose drive gains differ: give logs of one preset, "
            "or --gains"
        )
    return (names[0], DRIVES[names[0]]) if names and names[0] in DRIVES else None
