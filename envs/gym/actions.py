"""What an action means in each control mode, and the spaces of actions and observations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tauguard.arrays import Array
from tauguard.envs.gym.compiled import CompiledScene

#: Speed [m/s] and angular speed [rad/s] of the tool at an action of 1 in Cartesian mode.
CARTESIAN_SPEED, CARTESIAN_TURN = 0.5, 1.5
#: In position mode an action of 1 is this far from home [rad], or the joint's limit if nearer.
POSITION_REACH = 2.0
#: At a joint without torque limit, an action of 1 is the servo's torque at this error [rad].
SOFT_LIMIT = 0.1
#: Bounds of the observation: speed [rad/s, m/s], torque without a known limit [N m], distance [m].
SPEED_BOUND, TORQUE_BOUND, DISTANCE_BOUND = 100.0, 1e4, 100.0


@dataclass(frozen=True)
class Entry:
    """One row of a table of actions or observations."""

    name: str
    low: float
    high: float
    unit: str
    goal: bool = False  #: depends on the target, so that ``goal=True`` leaves it out


def action_table(compiled: CompiledScene) -> list[Entry]:
    """Name, unit, and meaning of -1 and 1 (``low`` and ``high``) of each entry of an action."""
    centre, scale = action_scale(compiled)
    unit = {
        "current": "A",
        "torque": "N m, on top of gravity compensation",
        "joint_velocity": "rad/s",
        "joint_position": "rad",
    }
    mode = compiled.settings.control
    if mode != "cartesian":
        return [
            Entry(f"{mode} of {name}", float(c - s), float(c + s), unit[mode])
            for name, c, s in zip(compiled.scene.joint_names, centre, scale, strict=True)
        ]
    names = [f"{kind} {axis}" for kind in ("move along", "turn about") for axis in "xyz"]
    units = ["m per action"] * 3 + ["rad per action"] * 3
    return [
        Entry(f"tool {a + 1}: {name}", -float(s), float(s), u)
        for a in range(len(compiled.tools))
        for name, u, s in zip(names, units, scale[6 * a : 6 * a + 6], strict=True)
    ]


def action_scale(compiled: CompiledScene) -> tuple[Array, Array]:
    """Centre and half-width of the range of an action, shapes (m,)."""
    settings, n = compiled.settings, len(compiled.scene.joint_names)
    zero = np.zeros(n)
    if settings.control == "cartesian":
        period = 1 / settings.control_rate
        one = np.repeat([CARTESIAN_SPEED * period, CARTESIAN_TURN * period], 3)
        scale = np.tile(one, len(compiled.tools))
        return np.zeros_like(scale), scale
    if settings.control == "joint_velocity":
        return zero, compiled.max_speed
    if settings.control == "joint_position":
        low = np.maximum(compiled.joint_range[:, 0], compiled.scene.home - POSITION_REACH)
        high = np.minimum(compiled.joint_range[:, 1], compiled.scene.home + POSITION_REACH)
        return (low + high) / 2, (high - low) / 2
    torque = np.where(
        np.isfinite(compiled.torque_limit), compiled.torque_limit, SOFT_LIMIT * compiled.gains.kp
    )
    if settings.control == "torque":
        return zero, torque
    return zero, torque / np.abs(compiled.nominal.gain)


def observation_table(compiled: CompiledScene) -> list[Entry]:
    """Names, ranges and units of the observation, entry by entry."""
    joints = compiled.scene.joint_names
    turn = np.where(
        np.isfinite(compiled.joint_range),
        compiled.joint_range,
        [[-4 * np.pi, 4 * np.pi]] * len(joints),
    )
    turn = turn + np.array([-0.5, 0.5])
    most = np.where(np.isfinite(compiled.torque_limit), compiled.torque_limit, TORQUE_BOUND)
    rows = [
        Entry(f"position of {name}", float(low), float(high), "rad")
        for name, (low, high) in zip(joints, turn, strict=True)
    ]
    rows += [Entry(f"velocity of {name}", -SPEED_BOUND, SPEED_BOUND, "rad/s") for name in joints]
    rows += [
        Entry(f"motor torque of {name}", -1.5 * float(m), 1.5 * float(m), "N m")
        for name, m in zip(joints, most, strict=True)
    ]
    tools = [f"tool {i + 1}" for i in range(len(compiled.tools))]
    parts = [(f"position of {tool}", "m", DISTANCE_BOUND, False) for tool in tools]
    parts += [(f"target less {tool}", "m", DISTANCE_BOUND, True) for tool in tools]
    for region in compiled.regions:
        parts += [
            (f"position of the {region.name}", "m", DISTANCE_BOUND, False),
            (f"velocity of the {region.name}", "m/s", SPEED_BOUND, False),
        ]
    return rows + [
        Entry(f"{name}, {axis}", -bound, bound, unit, goal)
        for name, unit, bound, goal in parts
        for axis in "xyz"
    ]
