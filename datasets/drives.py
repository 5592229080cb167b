"""Drive gains (joint torque per motor current) of the arms of the column presets."""

from collections.abc import Sequence

from tauguard.findings import ArgumentError
from tauguard.traces.trace import Trace

#: Joint torque per motor current [N m/A], one number per joint, by the name of the preset.
DRIVES = {
    # Mamedov et al. 2020 (doi 10.3389/frobt.2020.571574), identified on one arm. Another source
    # gives gains up to 50 % higher: identify your own arm's gains if you can.
    "ur10e": (10.0, 10.70, 8.46, 9.00, 9.48, 10.12),
    # Ratio of the target torques to the target currents of a UR5's controller, by least squares
    # over its logs. The last joint's gain is not identifiable; the last two joints have the same
    # drive.
    "ur5": (12.0, 10.6, 11.1, 9.9, 10.3, 10.3),
}


def preset_gains(logs: Sequence[Trace]) -> tuple[float, ...]:
    """Drive gains of the preset of the logs' columns; empty: not known.

    Raises:
        ArgumentError: the logs have columns of different presets, and the drive of one is known.
    """
    names = sorted({log.meta.get("columns", "no preset") for log in logs})
    if len(names) > 1 and not DRIVES.keys().isdisjoint(names):
        raise ArgumentError(
            f"logs of {', '.join(names)}, whose drive gains differ: give logs of one preset, "
            "or --gains"
        )
    return DRIVES.get(names[0], ()) if names else ()
