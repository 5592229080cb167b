"""The physics of an environment without the environment: MuJoCo's own loops of the same motion."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import gymnasium
import mujoco
import numpy as np
from mujoco import rollout
from mujoco.batch import Batch

from tauguard.arrays import Array
from tauguard.detectors import RobotNumbers, inverse_dynamics
from tauguard.envs import Motion, Simulation
from tauguard.envs.gym.base import ArmEnv
from tauguard.models import SceneSpec, compose, pin_model

REACH = "tauguard:tauguard/Reach-v0"
#: Steps from one state of a recorded motion to the next at which a rollout begins.
PIECE = 100


def reach(seed: int, **keywords: Any) -> ArmEnv:
    """A Reach environment without Gymnasium's own wrappers."""
    env = gymnasium.make(REACH, **keywords).unwrapped
    assert isinstance(env, ArmEnv)
    env.reset(seed=seed)
    return env


def driven(env: ArmEnv, actions: np.ndarray, seed: int) -> Callable[[], object]:
    """The same physics and drives in a bare native loop: no observation, no reward."""
    plant, steps = env.batch.plants[0], env.compiled.settings.substeps
    rows = actions.astype(np.float64)

    def call() -> None:
        env.reset(seed=seed)
        for action in rows:
            plant.begin(action)
            plant.run(steps)

    return call


def recorded(env: ArmEnv, actions: np.ndarray, seed: int) -> tuple[np.ndarray, float]:
    """Forces of the drives at every physics step, and the joint error of their replay [rad]."""
    env.reset(seed=seed)
    plant, data, found = env.batch.plants[0], env.batch.datas[0], []
    for action in actions.astype(np.float64):
        plant.begin(action)
        for _ in range(env.compiled.settings.substeps):
            plant.run(1)
            found.append(data.qfrc_applied.copy())
        plant.finish()
    assert not env.batch.metrics["diverged"][0]
    last = data.qpos[env.compiled.scene.qpos_adr].copy()
    forces = np.array(found)
    states, _ = bare(env, forces, seed)()
    model, adr = env.compiled.scene.model, env.compiled.scene.qpos_adr
    return forces, float(np.abs(states[0, -1, 1 : 1 + model.nq][adr] - last).max())


def bare(env: ArmEnv, forces: np.ndarray, seed: int) -> Callable[[], Any]:
    """MuJoCo's rollout of the same scene, start and forces."""
    model = env.compiled.scene.model
    env.reset(seed=seed)
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    state = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, env.batch.datas[0], state, kind)
    data = mujoco.MjData(model)
    applied = int(mujoco.mjtState.mjSTATE_QFRC_APPLIED)

    def call() -> Any:
        env.reset(seed=seed)  # as the others do
        return rollout.rollout(
            model, data, initial_state=state, control=forces[None], control_spec=applied
        )

    return call


def batched(seed: int, copies: int, count: int, threads: int) -> tuple[Callable[[], object], float]:
    """``mujoco.batch`` alone: copies of the scene under constant forces.

    Returns:
        The call, and its copies' largest joint difference from ``mj_step`` of one of them [rad].
    """
    env = reach(seed)
    model, data = env.compiled.scene.model, env.batch.datas[0]
    env.step(np.zeros(6))
    batch = Batch(model, copies, threads)
    start, force = data.qpos.copy(), data.qfrc_applied.copy()
    substeps = env.compiled.settings.substeps

    def call() -> None:
        batch.qpos[:], batch.qvel[:], batch.qfrc_applied[:] = start, 0.0, force
        for _ in range(count):
            batch.step(nstep=substeps)

    single = mujoco.MjData(model)
    single.qpos[:], single.qfrc_applied[:] = start, force
    for _ in range(count * substeps):
        mujoco.mj_step(model, single)
    call()
    return call, float(np.abs(batch.qpos - single.qpos).max())


def rollout_along(motion: Motion) -> Any:
    """MuJoCo's rollout of the bare arm along a motion, with the motion's torques applied."""
    scene = compose(SceneSpec(labels=False))
    robot = RobotNumbers.from_pin(pin_model(scene.arm_xml))
    tau = inverse_dynamics(robot, motion.q, motion.qd, motion.qdd)
    data = mujoco.MjData(scene.model)
    data.qpos[scene.qpos_adr] = motion.q[0]
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    state = np.empty(mujoco.mj_stateSize(scene.model, kind))
    mujoco.mj_getState(scene.model, data, state, kind)
    applied = int(mujoco.mjtState.mjSTATE_QFRC_APPLIED)
    return lambda: rollout.rollout(
        scene.model, data, initial_state=state, control=tau[None], control_spec=applied
    )


def rollout_pieces(simulation: Simulation, q: Array, qd: Array) -> tuple[float, float]:
    """Processor seconds of ``mujoco.rollout`` over the same motion, and its largest error [rad].

    The same scene is stepped as often, in pieces of :data:`PIECE` steps that begin at states of the
    recorded motion, under the feed-forward torques: without drives, friction, controller, contacts
    or labels.
    """
    scene, model = simulation.scene, simulation.scene.model
    feed: Any = simulation._feed_forward
    pieces = len(q) // PIECE
    data = mujoco.MjData(model)
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    initial = np.empty((pieces, mujoco.mj_stateSize(model, kind)))
    for piece in range(pieces):
        data.qpos[scene.qpos_adr] = q[piece * PIECE]
        data.qvel[scene.dof_adr] = qd[piece * PIECE]
        mujoco.mj_getState(model, data, initial[piece], kind)
    control = np.zeros((pieces, PIECE, model.nv))
    control[:, :, scene.dof_adr] = feed[: pieces * PIECE].reshape(pieces, PIECE, -1)
    spec = int(mujoco.mjtState.mjSTATE_QFRC_APPLIED)
    began = time.process_time()
    states, _ = rollout.rollout(model, data, initial, control, control_spec=spec)
    spent = time.process_time() - began
    positions = states[:, -1, 1 + scene.qpos_adr]
    wanted = q[PIECE : pieces * PIECE + 1 : PIECE]
    return spent, float(np.abs(positions[: len(wanted)] - wanted).max(initial=0.0))
