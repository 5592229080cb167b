"""Whether a robot file is the one that a model or a log goes with."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tauguard.detectors import RobotNumbers
    from tauguard.traces import Trace

#: Lengths of one arm's robot files differ by no more [m], nor do its rotations.
SAME_PLACE = 1e-3


def check_robot(robot: Path, trained: RobotNumbers, model: Path) -> None:
    """Refuse a robot file that is none, or that is not of the arm that a model was trained on.

    Its joints must be those, and stand where they did: calibration changes masses, not lengths.

    Raises:
        ValueError: one line that names both files.
    """
    import numpy as np

    from tauguard.detectors import RobotNumbers
    from tauguard.detectors.calibration.held_joints import holding
    from tauguard.models import pin_model

    try:
        numbers = RobotNumbers.from_pin(pin_model(robot))
    except ValueError as error:
        name = "" if str(robot) in str(error) else f"{robot}: "
        raise ValueError(f"{name}{error}") from None
    own, names = numbers.joint_names, trained.joint_names
    if not set(names) <= set(own):
        raise ValueError(
            f"{robot} has the joints {', '.join(own)}; {model} was trained on {', '.join(names)}"
        )
    held = holding(numbers, [name for name in own if name not in names])
    order = [held.joint_names.index(name) for name in names]
    moved = np.abs(held.translation[order] - trained.translation).max(axis=1)
    turned = np.abs(held.rotation[order] - trained.rotation).max(axis=(1, 2))
    if (moved > SAME_PLACE).any() or (turned > SAME_PLACE).any():
        joint = int(np.argmax(np.maximum(moved, turned)))
        raise ValueError(
            f"{robot} is not the arm that {model} was trained on: {names[joint]} stands "
            f"{1e3 * moved[joint]:.0f} mm from where it stood; give the robot file of training"
        )


def check_named(robot: Path, columns: str | None, traces: Sequence[Trace]) -> None:
    """Refuse a UR's robot file beside columns that are those of another UR.

    Where the preset of the columns brings the numbers of its arm; other names say nothing.

    Raises:
        ValueError: one line that names both.
    """
    known = r"ur(?:3|5|10|16|20|30)e?"
    name = re.search(r'<(?:robot|mujoco)[^>]*?(?:name|model)="([^"]*)"', robot.read_text())
    names = f"{name.group(1) if name else ''} {robot.stem}".lower()
    arms = re.findall(rf"(?<![a-z0-9]){known}(?![a-z0-9])", names)
    presets = {str(trace.meta.get("columns") or columns) for trace in traces}
    others = sorted(p for p in presets if re.fullmatch(known, p) and arms and p not in arms)
    if others:
        raise ValueError(
            f"{robot.name} is the file of a {arms[0]}, the columns are those of a {others[0]}: "
            f"give the {others[0]}'s file; if the log is of a {arms[0]}, give its own --gains or a "
            "column map with its torques"
        )
