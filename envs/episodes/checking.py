"""Run contact checkers along the recorded motion of an episode's arm and obstacles."""

from collections.abc import Iterator, Sequence

import mujoco
import numpy as np

from tauguard.arrays import Array
from tauguard.contacts import Checker, State, check_states
from tauguard.envs.episodes.loop import Rollout
from tauguard.models import Scene
from tauguard.traces import CheckedContacts

#: An obstacle whose position changes by more than this in one step was placed anew [m].
JUMP = 0.25


def checked(
    scene: Scene, t: Array, rollout: Rollout, checkers: Sequence[str | Checker]
) -> tuple[CheckedContacts, ...]:
    """The contacts that each checker reports on the true motion of an episode.

    Args:
        scene: the simulated scene.
        t: times of the rows [s], shape (T,).
        rollout: the recorded states of the scene.
        checkers: checkers, or names of registered ones.

    Raises:
        ValueError: an unknown checker, or one that cannot handle the scene.
    """
    if not checkers:
        return ()
    return check_states(scene.model, _states(scene, t, rollout), checkers)


def _states(scene: Scene, t: Array, rollout: Rollout) -> Iterator[State | None]:
    model = scene.model
    data, scratch = mujoco.MjData(model), mujoco.MjData(model)
    bodies = [model.body(name) for name in scene.obstacle_names]
    place = rollout.poses[:, :, :3]
    far = np.linalg.norm(np.diff(place, axis=0), axis=2) > JUMP
    jumped = np.concatenate([[False], far.any(axis=1)])
    for row in range(len(t)):
        data.time = t[row]
        data.qpos[scene.qpos_adr] = rollout.q[row]
        data.qvel[scene.dof_adr] = rollout.qd[row]
        for body, pose in zip(bodies, rollout.poses[row], strict=True):
            mocap = int(model.body_mocapid[body.id])
            if mocap >= 0:
                data.mocap_pos[mocap], data.mocap_quat[mocap] = pose[:3], pose[3:]
            else:
                begin = int(model.jnt_qposadr[body.jntadr[0]])
                data.qpos[begin : begin + 7] = pose
        if jumped[row]:
            yield None
        yield State.of(model, data, scratch)
