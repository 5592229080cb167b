"""Jobs of the slow test of processes, in a module that a spawned process can import."""

import mujoco
import numpy as np

from tauguard.rigid import Hulls, distance

_STATE = mujoco.mjtState.mjSTATE_INTEGRATION


def rolled(guard):
    """The bits of the state after eight guarded steps."""
    for _ in range(8):
        guard.step()
    state = np.empty(mujoco.mj_stateSize(guard.model, _STATE))
    mujoco.mj_getState(guard.model, guard.data, state, _STATE)
    return state.tobytes()


def bodies(seed):
    points = np.random.default_rng(seed).normal(size=(8000, 3)) + seed
    return Hulls(points, np.arange(0, 8001, 8))


def distances(seed):
    """The bits of the distances of a thousand hulls."""
    return distance(bodies(0), bodies(seed)).distance.tobytes()
