"""A wrapper that leaves every episode behind as an MCAP recording, a row a physics step."""

from __future__ import annotations

import hashlib
import importlib.metadata
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tauguard.arrays import Array
from tauguard.detectors import find_alarms
from tauguard.envs.episodes.labels import Wrenches, collisions
from tauguard.envs.gym.base import ArmEnv, arm_env
from tauguard.traces import Detection, Trace, Truth, write_mcap


@dataclass
class _Rows:
    """What one episode left so far; a block an action."""

    q: list[Array] = field(default_factory=list)
    qd: list[Array] = field(default_factory=list)
    current: list[Array] = field(default_factory=list)
    tau: list[Array] = field(default_factory=list)
    contact: list[Array] = field(default_factory=list)
    region: list[Array] = field(default_factory=list)
    residual: list[Array] = field(default_factory=list)
    alarm: list[NDArray[np.bool_]] = field(default_factory=list)


class RecordMcap(gymnasium.Wrapper[Array, Array, Array, Array], RecordConstructorArgs):
    """Writes ``FOLDER/episode_00000.mcap`` and so on, each when its episode ends.

    A recording has a row for every physics step: measured (where the drive has sensors and a
    detector or noise is on) or true positions, velocities and currents, and the truth: external
    torque, contact force, link and point, collisions, where the body regions were. With a detector
    its residual and alarms are in it. ``tauguard replay`` shows it.
    """

    def __init__(self, env: gymnasium.Env[Array, Array], folder: str | Path) -> None:
        """Choose the folder; it is made if it is not there."""
        RecordConstructorArgs.__init__(self, folder=folder)
        gymnasium.Wrapper.__init__(self, env)
        self._arm: ArmEnv = arm_env(env)
        self._folder = Path(folder)
        self._folder.mkdir(parents=True, exist_ok=True)
        self._count, self._rows = 0, _Rows()
        self._seed = ""
        self.files: list[Path] = []

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Write what there is, and begin an episode."""
        self._finish()
        self._seed = "" if seed is None else str(seed)
        result: tuple[Array, dict[str, Any]] = self.env.reset(seed=seed, options=options)
        return result

    def step(self, action: Array) -> tuple[Array, Any, bool, bool, dict[str, Any]]:
        """Act, and keep the rows of the action."""
        result = self.env.step(action)
        if not result[4]["reason"]:
            self._keep()
        if result[2] or result[3]:
            self._finish()
        return result

    def close(self) -> None:
        """Write what there is."""
        self._finish()
        super().close()

    def _keep(self) -> None:
        cell, rows = self._arm.cell, self._rows
        signals = (cell.q[0], cell.qd[0], cell.current[0])
        if cell.sensing is not None:
            signals = cell.sensing[0].measured
            rows.residual.append(cell.sensing[0].residuals.copy())
            rows.alarm.append(cell.sensing[0].alarms.copy())
        for kept, signal in zip((rows.q, rows.qd, rows.current), signals, strict=True):
            kept.append(signal.copy())
        rows.tau.append(cell.tau[0].copy())
        rows.contact.append(cell.contact[0].copy())
        rows.region.append(cell.region[0].copy())

    def _finish(self) -> None:
        rows, self._rows = self._rows, _Rows()
        if not rows.q:
            return
        trace = self._trace(rows)
        detection = None
        if rows.alarm and self._arm.cell.sensing and self._arm.cell.sensing[0].detector:
            detector = self._arm.cell.sensing[0].detector
            alarm, residual = np.concatenate(rows.alarm), np.concatenate(rows.residual)
            detection = Detection(
                detector=detector.name,
                t=trace.t,
                residual=residual,
                score=alarm.astype(float),
                threshold=0.5,
                alarm=alarm,
                alarms=find_alarms(trace.t, alarm),
            )
        path = self._folder / f"episode_{self._count:05d}.mcap"
        write_mcap(path, trace, detection)
        self.files.append(path)
        self._count += 1

    def _trace(self, rows: _Rows) -> Trace:
        world = self._arm.world
        q, tau, contact = (np.concatenate(part) for part in (rows.q, rows.tau, rows.contact))
        t: Array = np.arange(len(q), dtype=np.float64) * world.settings.timestep
        spec = self._arm.spec
        return Trace(
            joint_names=world.scene.joint_names,
            t=t,
            q=q,
            qd=np.concatenate(rows.qd),
            current=np.concatenate(rows.current),
            truth=self._truth(t, tau, contact, np.concatenate(rows.region)),
            meta={
                "seed": self._seed,
                "environment": "" if spec is None else spec.id,
                "model_sha256": hashlib.sha256(world.scene.xml.encode()).hexdigest(),
                "tauguard": importlib.metadata.version("tauguard"),
                "mujoco": mujoco.__version__,
            },
            attachments={"scene.xml": world.scene.xml, **world.scene.nominal_texts},
        )

    def _truth(self, t: Array, tau: Array, contact: Array, region: Array) -> Truth:
        world = self._arm.world
        links = len(world.scene.link_bodies)
        wrenches = Wrenches.empty(len(t), links)
        touched = np.flatnonzero(contact[:, 1] > 0)
        link = contact[touched, 1].astype(int) - 1
        wrenches.force[touched, link] = contact[touched, 5:8]
        wrenches.point[touched, link] = contact[touched, 2:5]
        poses = np.tile(np.eye(4), (*region.shape[:2], 1, 1))
        if region.size:
            turns = Rotation.from_quat(region[..., 3:].reshape(-1, 4), scalar_first=True)
            poses[:, :, :3, :3] = turns.as_matrix().reshape(*region.shape[:2], 3, 3)
        poses[:, :, :3, 3] = region[..., :3]
        return Truth(
            tau_ext=tau,
            contact_force=contact[:, 0].copy(),
            collisions=collisions(t, wrenches, tau, []),
            payload=np.full(len(t), world.settings.payload_g / 1000),
            contact_link=contact[:, 1].astype(np.int64),
            contact_point=contact[:, 2:5].copy(),
            contact_vector=contact[:, 5:8].copy(),
            obstacle_names=tuple(r.name for r in world.regions),
            obstacle_poses=poses,
        )
