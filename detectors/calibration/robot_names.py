"""Whether a robot file, a detector and the columns of logs are of one arm."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tauguard.detectors.dynamics.robot import RobotNumbers, holding
from tauguard.findings import Finding, cause
from tauguard.traces.trace import Trace
from tauguard.untrusted_input import read_text

#: Two files describe the same arm if each joint's position [m], and each entry of its rotation
#: matrix, differ by at most this.
SAME_PLACE = 1e-3


def other_arm_finding(
    numbers: RobotNumbers, robot: Path, trained: RobotNumbers, model: str
) -> Finding | None:
    """An error ``"other-arm"`` if a detector was trained on another arm than that of a robot file.

    Names and placements of the joints must agree. Masses may differ: calibration changes them.

    Args:
        numbers: of the file ``robot``.
        robot: the robot file, which the text names.
        trained: the detector's numbers.
        model: name of the detector in the text.
    """
    own, names = numbers.joint_names, trained.joint_names
    if not set(names) <= set(own):
        text = f"{robot} has the joints {', '.join(own)}; {model} was trained on {', '.join(names)}"
        return cause("other-arm", text)
    held = holding(numbers, [name for name in own if name not in names])
    order = [held.joint_names.index(name) for name in names]
    moved = np.abs(held.translation[order] - trained.translation).max(axis=1)
    turned = np.abs(held.rotation[order] - trained.rotation).max(axis=(1, 2))
    if not ((moved > SAME_PLACE).any() or (turned > SAME_PLACE).any()):
        return None
    joint = int(np.argmax(np.maximum(moved, turned)))
    text = (
        f"{robot} is not the arm that {model} was trained on: {names[joint]} is "
        f"{1e3 * moved[joint]:.0f} mm from its place there; give the robot file that the model "
        "was trained with"
    )
    return cause("other-arm", text, names[joint])


def robot_name_finding(robot: Path, traces: Sequence[Trace]) -> Finding | None:
    """An error ``"robot-name"`` for a file of one UR model with a column preset of another.

    The preset would supply the gains of the wrong arm. Files and presets of other names are
    accepted.
    """
    known = r"ur(?:3|5|10|16|20|30)e?"
    name = re.search(r'<(?:robot|mujoco)[^>]*?(?:name|model)="([^"]*)"', read_text(robot))
    names = f"{name.group(1) if name else ''} {robot.stem}".lower()
    arms = re.findall(rf"(?<![a-z0-9]){known}(?![a-z0-9])", names)
    presets = {trace.meta.get("columns", "") for trace in traces}
    others = sorted(p for p in presets if re.fullmatch(known, p) and arms and p not in arms)
    if not others:
        return None
    text = (
        f"{robot.name} is the file of a {arms[0]}, the columns are those of a {others[0]}: "
        f"give the {others[0]}'s file; if the log is of a {arms[0]}, give its own `gains=` or a "
        "column map with its torques"
    )
    return cause("robot-name", text)
