"""Contact checkers on an episode: the recorded motion of the arm and of the obstacles, replayed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import mujoco
import numpy as np

from tauguard.arrays import Array
from tauguard.contacts import Checker, State, watch
from tauguard.envs.loop import Recording
from tauguard.models import Scene
from tauguard.traces import CheckedContacts

#: An obstacle that is this much farther after one step was put there and did not move there [m].
JUMP = 0.25


def checked(
    scene: Scene, t: Array, recording: Recording, checkers: Sequence[str | Checker]
) -> tuple[CheckedContacts, ...]:
    """What each checker sees on the true motion of an episode.

    Args:
        scene: whose arm and obstacles were recorded.
        t: times of the rows [s], shape (T,).
        recording: what the simulation loop saw.
        checkers: names of registered checkers, or checkers.

    Raises:
        ValueError: an unknown checker, or one that cannot handle the scene.
    """
    if not checkers:
        return ()
    return watch(scene.model, _states(scene, t, recording), checkers)


def _states(scene: Scene, t: Array, recording: Recording) -> Iterator[State | None]:
    model = scene.model
    data, scratch = mujoco.MjData(model), mujoco.MjData(model)
    bodies = [model.body(name) for name in scene.obstacle_names]
    place = recording.poses[:, :, :3]
    far = np.linalg.norm(np.diff(place, axis=0), axis=2) > JUMP
    jumped = np.concatenate([[False], far.any(axis=1)])
    for row in range(len(t)):
        data.time = t[row]
        data.qpos[scene.qpos_adr] = recording.q[row]
        data.qvel[scene.dof_adr] = recording.qd[row]
        for body, pose in zip(bodies, recording.poses[row], strict=True):
            mocap = int(model.body_mocapid[body.id])
            if mocap >= 0:
                data.mocap_pos[mocap], data.mocap_quat[mocap] = pose[:3], pose[3:]
            else:
                begin = int(model.jnt_qposadr[body.jntadr[0]])
                data.qpos[begin : begin + 7] = pose
        if jumped[row]:
            yield None
        yield State.of(model, data, scratch)
