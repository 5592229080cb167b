"""How near operational space control keeps the tool of an arm to where it should be."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pinocchio as pin

from tauguard.envs.controllers import OperationalSpace
from tauguard.models import pin_model

#: Control rate [Hz].
RATE = 500.0
#: The goal relative to the tool at home [m].
OFFSET = (-0.03, 0.02, 0.02)
#: The controller's rest posture is home plus this angle in every joint [rad].
REST = 0.3


def tool_error(robot: str, ideal: bool, integral: float, seconds: float) -> float:
    """Distance of the tool from a goal near home after it has come to rest [mm], in MuJoCo.

    Args:
        robot: name or file of an arm of six joints or more (fewer cannot hold a pose).
        ideal: drives without friction, ripple and noise.
        integral: integral gain of the controller [1/s^3].
        seconds: simulated time, starting at home.
    """
    env: Any = gymnasium.make(
        "tauguard:tauguard/Reach-v0",
        control="current",
        control_rate=RATE,
        robot=robot,
        ideal_drive=ideal,
        obstacles=(),
        max_episode_steps=10_000,
    )
    env.reset(seed=0)
    inner = env.unwrapped
    scene, n = inner.scene, len(inner.scene.joint_names)
    model = pin_model(scene.arm_model)
    frame = scene.facts.tool or "tip"
    if scene.facts.tool is None:
        last = pin.Frame("tip", model.njoints - 1, pin.SE3.Identity(), pin.FrameType.OP_FRAME)
        model.addFrame(last)
    rest = scene.home + REST
    control = OperationalSpace(model, frame, rest=rest, integral=integral, dt=1 / RATE)
    goal = control.pose(scene.home).copy()
    goal[:3, 3] += OFFSET
    largest = np.array([entry.high for entry in inner.batch.actions])
    for _ in range(round(seconds * RATE)):
        q, qd = inner.data.qpos[scene.qpos_adr], inner.data.qvel[scene.dof_adr]
        current = control.torque(q, qd, goal) / inner.compiled.nominal.gain
        env.step(np.clip(current / largest, -1, 1)[:n])
    where = control.pose(inner.data.qpos[scene.qpos_adr])
    env.close()
    return 1e3 * float(np.linalg.norm(where[:3, 3] - goal[:3, 3]))
