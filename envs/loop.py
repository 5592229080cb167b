"""The simulation loop: a composed scene, its drive and position control, run natively."""

from __future__ import annotations

import ctypes
import functools
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.envs import _loop
from tauguard.models import Drive, Scene

Array = NDArray[np.float64]

#: Numbers per link in a scene's contact sensors: found, force (3), torque (3), position (3).
SENSOR_WIDTH = 10


class SimulationDiverged(RuntimeError):
    """The simulated arm left every sensible range; the message says when."""


@dataclass(frozen=True)
class Gains:
    """Stiffness and damping of the position control, joint by joint."""

    kp: Array  #: [N m/rad], shape (n,)
    kd: Array  #: [N m s/rad], shape (n,)

    @classmethod
    def for_scene(cls, scene: Scene, bandwidth: float = 30.0) -> Gains:
        """Critically damped gains for the arm's inertia in its first pose.

        Args:
            scene: the composed scene.
            bandwidth: natural frequency of every joint's loop [rad/s].
        """
        data = mujoco.MjData(scene.model)
        if scene.model.nkey:
            mujoco.mj_resetDataKeyframe(scene.model, data, 0)
        mujoco.mj_forward(scene.model, data)
        mass = np.zeros((scene.model.nv, scene.model.nv))
        mujoco.mj_fullM(scene.model, data, mass)
        inertia = np.diag(mass)[scene.dof_adr]
        return cls(bandwidth**2 * inertia, 2 * bandwidth * inertia)


@dataclass(frozen=True)
class Recording:
    """What the loop saw; row k belongs to the state before step k."""

    q: Array  #: true joint positions [rad], shape (T, n)
    qd: Array  #: true joint velocities [rad/s], shape (T, n)
    current: Array  #: true motor currents, held over the step [A], shape (T, n)
    contact: Array  #: contact sensors [found, N, N m, m], shape (T, links, SENSOR_WIDTH)
    poses: Array  #: obstacle positions and quaternions (wxyz), shape (T, obstacles, 7)


@functools.cache
def _library() -> ctypes.CDLL:
    """The MuJoCo library that the Python binding has loaded."""
    folder = Path(mujoco.__file__).parent
    names = [*folder.glob("libmujoco.so*"), *folder.glob("libmujoco*.dylib")]
    if not names:
        raise OSError(f"no MuJoCo library beside its Python binding in {folder.name}")
    return ctypes.CDLL(str(names[0]))


def function_address(name: str) -> int:
    """Address of one of its functions."""
    address = ctypes.cast(getattr(_library(), name), ctypes.c_void_p).value
    assert address is not None
    return address


def drive_numbers(drive: Drive, nominal: Drive, gains: Gains) -> list[dict[str, Any]]:
    """What the native joints are made of: the simulated drive, the servo's gains and beliefs."""
    friction, ripple = drive.friction, drive.ripple
    warm = 0.0 if friction is None else friction.temperature - friction.reference_temperature
    level = 0.0 if friction is None else 1 + friction.coulomb_per_kelvin * warm
    thick = 0.0 if friction is None else 1 + friction.viscous_per_kelvin * warm
    return [
        {
            "gain": drive.gain[i],
            "nominal_gain": nominal.gain[i],
            "limit": drive.current_limit[i],
            "gear": drive.gear[i],
            "coulomb": 0.0 if friction is None else friction.coulomb[i] * level,
            "breakaway": 0.0 if friction is None else friction.static[i] * level,
            "stribeck_velocity": 1.0 if friction is None else friction.stribeck_velocity[i],
            "viscous": 0.0 if friction is None else friction.viscous[i] * thick,
            "bristle_stiffness": 0.0 if friction is None else friction.bristle_stiffness[i],
            "load": 0.0 if friction is None else friction.load[i],
            "kp": gains.kp[i],
            "kd": gains.kd[i],
            "cycles": [] if ripple is None else [float(c) for c in ripple.cycles],
            "amplitude": [] if ripple is None else [float(a) for a in ripple.amplitude[i]],
            "phase": [] if ripple is None else [float(p) for p in ripple.phase[i]],
        }
        for i in range(len(drive.gain))
    ]


class SimulationLoop:
    """One scene's state with its drive; :meth:`run` follows a table of references."""

    def __init__(self, scene: Scene, nominal: Drive, gains: Gains | None = None) -> None:
        """Bind the native loop to ``scene``.

        Args:
            scene: the composed scene; ``scene.drive`` is what is simulated.
            nominal: what the controller believes about the drive (its gains).
            gains: of the position control; the default suits the arm's inertia.
        """
        self.scene = scene
        self.model = scene.model
        self.data = mujoco.MjData(scene.model)
        self.gains = gains or Gains.for_scene(scene)
        self._nominal = nominal
        self._obstacles = [scene.model.body(name).id for name in scene.obstacle_names]
        self._sensors = self._sensor_range()
        data, drive = self.data, scene.drive
        dt = scene.model.opt.timestep
        constant = drive.electrical_time_constant
        self._loop = _loop.Loop(
            step=function_address("mj_step"),
            model=scene.model._address,
            data=data._address,
            dt=dt,
            decay=float(np.exp(-dt / constant)) if constant else 0.0,
            qpos=data.qpos.ctypes.data,
            qvel=data.qvel.ctypes.data,
            qfrc_applied=data.qfrc_applied.ctypes.data,
            xfrc_applied=data.xfrc_applied.ctypes.data,
            xpos=data.xpos.ctypes.data,
            xquat=data.xquat.ctypes.data,
            sensordata=data.sensordata.ctypes.data,
            qpos_adr=[int(i) for i in scene.qpos_adr],
            dof_adr=[int(i) for i in scene.dof_adr],
            obstacle_bodies=self._obstacles,
            sensor_begin=self._sensors[0],
            sensor_count=self._sensors[1],
        )
        self._configure(drive)

    def _sensor_range(self) -> tuple[int, int]:
        model = self.model
        first = next(
            (i for i in range(model.nsensor) if "contact_link" in model.sensor(i).name), None
        )
        if first is None:
            return 0, 0
        links = sum("contact_link" in model.sensor(i).name for i in range(model.nsensor))
        return int(model.sensor_adr[first]), links * SENSOR_WIDTH

    def _configure(self, drive: Drive) -> None:
        for i, numbers in enumerate(drive_numbers(drive, self._nominal, self.gains)):
            self._loop.set_joint(i, **numbers)

    def reset(self, q: Array) -> None:
        """Start at rest at ``q`` [rad], shape (n,), with no current and relaxed bristles."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[self.scene.qpos_adr] = q
        self._loop.set_state(np.zeros(2 * self._loop.joints))
        mujoco.mj_forward(self.model, self.data)

    def save(self) -> tuple[Array, Array]:
        """The state of simulation and drive, for :meth:`restore`."""
        kind = mujoco.mjtState.mjSTATE_INTEGRATION
        state = np.empty(mujoco.mj_stateSize(self.model, kind))
        mujoco.mj_getState(self.model, self.data, state, kind)
        drive = np.empty(2 * self._loop.joints)
        self._loop.get_state(drive)
        return state, drive

    def restore(self, saved: tuple[Array, Array]) -> None:
        """Go back to what :meth:`save` gave."""
        mujoco.mj_setState(self.model, self.data, saved[0], mujoco.mjtState.mjSTATE_INTEGRATION)
        self._loop.set_state(saved[1])

    def run(
        self,
        q_des: Array,
        qd_des: Array,
        tau_ff: Array,
        wrench: Array | None = None,
        wrench_body: int = -1,
    ) -> Recording:
        """Run one step per row of the references.

        Args:
            q_des: [rad], shape (T, n).
            qd_des: [rad/s], shape (T, n).
            tau_ff: feed-forward torque [N m], shape (T, n).
            wrench: force [N] and torque about the centre of mass [N m] in the world frame, applied
                to ``wrench_body``, shape (T, 6).
            wrench_body: id of the body that the wrench acts on.

        Raises:
            SimulationDiverged: a joint position is not finite or a velocity beyond 1000 rad/s.
        """
        rows, joints = q_des.shape
        links = self._sensors[1] // SENSOR_WIDTH
        out = Recording(
            q=np.empty((rows, joints)),
            qd=np.empty((rows, joints)),
            current=np.empty((rows, joints)),
            contact=np.zeros((rows, links, SENSOR_WIDTH)),
            poses=np.empty((rows, len(self._obstacles), 7)),
        )
        sound = self._loop.run(
            np.ascontiguousarray(q_des),
            np.ascontiguousarray(qd_des),
            np.ascontiguousarray(tau_ff),
            np.zeros((0, 6)) if wrench is None else np.ascontiguousarray(wrench),
            wrench_body,
            out.q,
            out.qd,
            out.current,
            out.contact.reshape(rows, links * SENSOR_WIDTH),
            out.poses.reshape(rows, 7 * len(self._obstacles)),
        )
        if sound < rows:
            raise SimulationDiverged(
                f"the simulation diverged {sound} steps into a run of {rows} at "
                f"{self.data.time:.3f} s: a smaller timestep or softer contact would hold"
            )
        return out
