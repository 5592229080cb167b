"""The simulation loop: runs a scene with its drives and position control in native code."""

from __future__ import annotations

from dataclasses import dataclass, fields

import mujoco
import numpy as np

from tauguard.arrays import Array, in_a_line
from tauguard.envs import _plant
from tauguard.envs.episodes.motions import Motion
from tauguard.envs.plant import Gains, make_plant
from tauguard.models import Drive, Scene

#: Numbers per link in a scene's contact sensors: found, force (3), torque (3), position (3).
SENSOR_WIDTH = _plant.SENSOR_WIDTH


class SimulationDiverged(RuntimeError):
    """The simulation diverged; the message says when."""


@dataclass(frozen=True)
class Rollout:
    """The states that a loop recorded; row k is the state before step k."""

    __repr__ = in_a_line

    q: Array  #: true joint positions [rad], shape (T, n)
    qd: Array  #: true joint velocities [rad/s], shape (T, n)
    current: Array  #: true motor currents, constant during a step [A], shape (T, n)
    contact: Array  #: contact sensors [found, N, N m, m], shape (T, links, SENSOR_WIDTH)
    poses: Array  #: obstacle positions and quaternions (wxyz), shape (T, obstacles, 7)

    def rows(self, begin: int, end: int) -> Rollout:
        """A view of some of the rows."""
        return Rollout(*(getattr(self, f.name)[begin:end] for f in fields(self)))


class SimulationLoop:
    """The state of a scene and of its drive; :meth:`run` follows a table of references."""

    def __init__(self, scene: Scene, nominal: Drive, gains: Gains | None = None) -> None:
        """Bind the native loop to ``scene``.

        Args:
            scene: the composed scene, with the simulated drive in ``scene.drive``.
            nominal: drive that the controller assumes.
            gains: gains of the position control; default: :meth:`Gains.for_scene`.
        """
        self.scene = scene
        self.model = scene.model
        self.data = mujoco.MjData(scene.model)
        self.gains = gains or Gains.for_scene(scene)
        self._obstacles = [scene.model.body(name).id for name in scene.obstacle_names]
        self._sensors = self._sensor_range()
        self._plant = make_plant(scene, nominal, self.gains, self.data)

    def _sensor_range(self) -> tuple[int, int]:
        model = self.model
        first = next(
            (i for i in range(model.nsensor) if "contact_link" in model.sensor(i).name), None
        )
        if first is None:
            return 0, 0
        links = sum("contact_link" in model.sensor(i).name for i in range(model.nsensor))
        return int(model.sensor_adr[first]), links * SENSOR_WIDTH

    def reset(self, q: Array) -> None:
        """Start at rest at ``q`` [rad], shape (n,), without currents; friction states are zero."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[self.scene.qpos_adr] = q
        self._plant.relax()
        mujoco.mj_forward(self.model, self.data)

    def save(self) -> tuple[Array, Array]:
        """The state of simulation and drive, for :meth:`restore`."""
        kind = mujoco.mjtState.mjSTATE_INTEGRATION
        state = np.empty(mujoco.mj_stateSize(self.model, kind))
        mujoco.mj_getState(self.model, self.data, state, kind)
        return state, np.array(self._plant.state())

    def restore(self, saved: tuple[Array, Array]) -> None:
        """Restore a state of :meth:`save`."""
        mujoco.mj_setState(self.model, self.data, saved[0], mujoco.mjtState.mjSTATE_INTEGRATION)
        self._plant.restore(saved[1].tolist())

    def take(self, other: SimulationLoop) -> None:
        """Continue from the state of the arm and its drive in ``other``, a loop of the same arm."""
        own, theirs = self.scene, other.scene
        self.data.time = other.data.time
        self.data.qpos[own.qpos_adr] = other.data.qpos[theirs.qpos_adr]
        self.data.qvel[own.dof_adr] = other.data.qvel[theirs.dof_adr]
        self.data.qacc_warmstart[own.dof_adr] = other.data.qacc_warmstart[theirs.dof_adr]
        self._plant.restore(other._plant.state())

    def room_for(self, rows: int) -> Rollout:
        """A rollout of ``rows`` rows without contact; obstacles are where they are now."""
        joints, links = len(self.scene.joint_names), self._sensors[1] // SENSOR_WIDTH
        poses = np.empty((rows, len(self._obstacles), 7))
        poses[..., :3] = self.data.xpos[self._obstacles]
        poses[..., 3:] = self.data.xquat[self._obstacles]
        return Rollout(
            q=np.empty((rows, joints)),
            qd=np.empty((rows, joints)),
            current=np.empty((rows, joints)),
            contact=np.zeros((rows, links, SENSOR_WIDTH)),
            poses=poses,
        )

    def run(
        self,
        q_des: Array,
        qd_des: Array,
        tau_ff: Array,
        wrench: Array | None = None,
        wrench_body: int = -1,
        out: Rollout | None = None,
    ) -> Rollout:
        """Run one step per row of the references.

        Args:
            q_des: reference positions [rad], shape (T, n).
            qd_des: reference velocities [rad/s], shape (T, n).
            tau_ff: feed-forward torque [N m], shape (T, n).
            wrench: force [N] and torque about the centre of mass [N m] in the world frame, applied
                to ``wrench_body``, shape (T, 6).
            wrench_body: id of the body that the wrench acts on.
            out: a rollout of T rows to write into (default: a new one).

        Raises:
            SimulationDiverged: a joint position is not finite, or a velocity is beyond 1000 rad/s.
        """
        rows = len(q_des)
        out = self.room_for(rows) if out is None else out
        track = _plant.Track(
            q=out.q,
            qd=out.qd,
            current=out.current,
            sensors=out.contact.reshape(rows, self._sensors[1]),
            poses=out.poses,
            bodies=self._obstacles,
            sensor_begin=self._sensors[0],
        )
        sound = self._plant.follow(
            np.ascontiguousarray(q_des),
            np.ascontiguousarray(qd_des),
            np.ascontiguousarray(tau_ff),
            np.zeros((0, 6)) if wrench is None else np.ascontiguousarray(wrench),
            0 if wrench is None else wrench_body,
            track,
        )
        if sound < rows:
            raise SimulationDiverged(
                f"the simulation diverged at {self.data.time:.3f} s, after {sound} of {rows} "
                f"steps: use a smaller timestep or softer contacts"
            )
        return out


@dataclass(frozen=True)
class AlongMotion:
    """Runs a loop along rows of one motion, and writes the states into ``recorded``."""

    loop: SimulationLoop
    motion: Motion
    feed_forward: Array  #: torque at every row [N m], shape (T, n)
    recorded: Rollout  #: states at all rows of the motion

    def __call__(
        self, start: int, stop: int, wrench: Array | None = None, body: int = -1
    ) -> Rollout:
        """Run rows ``start`` to ``stop``, with a wrench on a body if one is given."""
        rows, out = slice(start, stop), self.recorded.rows(start, stop)
        wanted = self.motion.q[rows], self.motion.qd[rows], self.feed_forward[rows]
        return self.loop.run(*wanted, wrench, body, out)
