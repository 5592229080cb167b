"""A wrapper that writes every episode as an MCAP recording, with one row per physics step."""

import hashlib
import importlib.metadata
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.detectors import find_alarms
from tauguard.envs.episodes.labels import Wrenches, collisions, homogeneous
from tauguard.envs.gym.base import ArmEnv, arm_env
from tauguard.traces import TARGETS, Detection, Trace, Truth, write_mcap


@dataclass
class _Rows:
    """The recorded data of one episode so far, one block per action."""

    q: list[Array] = field(default_factory=list)
    qd: list[Array] = field(default_factory=list)
    current: list[Array] = field(default_factory=list)
    tau: list[Array] = field(default_factory=list)
    contact: list[NDArray[np.void]] = field(default_factory=list)
    region: list[NDArray[np.void]] = field(default_factory=list)
    residual: list[Array] = field(default_factory=list)
    alarm: list[NDArray[np.bool_]] = field(default_factory=list)
    targets: list[tuple[float, Any]] = field(default_factory=list)  #: start times [s], places [m]


class RecordMcap(gymnasium.Wrapper[Array, Array, Array, Array], RecordConstructorArgs):
    """Writes one file ``FOLDER/episode_00000.mcap``, ... at the end of each episode.

    A recording has one row per physics step. Its positions, velocities and currents are measured
    if the environment has a detector or noise, and true otherwise. Its truth consists of external
    torque, contact force, link and point, collisions, and the places of body regions. It also has
    the targets and, with a detector, the residual and the alarms. ``tauguard replay`` shows it.
    """

    def __init__(self, env: gymnasium.Env[Array, Array], folder: str | Path) -> None:
        """Choose the folder, which is created if it does not exist."""
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
        """Write the recording of the last episode, and begin another episode."""
        self._finish()
        self._seed = "" if seed is None else str(seed)
        result: tuple[Array, dict[str, Any]] = self.env.reset(seed=seed, options=options)
        return result

    def step(self, action: Array) -> tuple[Array, Any, bool, bool, dict[str, Any]]:
        """Apply the action, and store its rows."""
        targets = self._arm.batch.target[0].tolist()
        result = self.env.step(action)
        if not self._arm.batch.metrics["diverged"][0]:
            if not self._rows.targets or self._rows.targets[-1][1] != targets:
                done = sum(len(part) for part in self._rows.q)
                self._rows.targets.append((done * self._arm.compiled.settings.timestep, targets))
            self._keep()
        if result[2] or result[3]:
            self._finish()
        return result

    def close(self) -> None:
        """Write the recording of the last episode, and close the environment."""
        self._finish()
        super().close()

    def _keep(self) -> None:
        batch, rows = self._arm.batch, self._rows
        signals = (batch.q[0], batch.qd[0], batch.current[0])
        if batch.sensing is not None:
            signals = batch.sensing[0].measured
            rows.residual.append(batch.sensing[0].residuals.copy())
            rows.alarm.append(batch.sensing[0].alarms.copy())
        for kept, signal in zip((rows.q, rows.qd, rows.current), signals, strict=True):
            kept.append(signal.copy())
        rows.tau.append(batch.tau[0].copy())
        rows.contact.append(batch.contact[0].copy())
        rows.region.append(batch.region[0].copy())

    def _finish(self) -> None:
        rows, self._rows = self._rows, _Rows()
        if not rows.q:
            return
        trace = self._trace(rows)
        detection = None
        if rows.alarm and self._arm.batch.sensing and self._arm.batch.sensing[0].detector:
            detector = self._arm.batch.sensing[0].detector
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
        compiled = self._arm.compiled
        q, tau = np.concatenate(rows.q), np.concatenate(rows.tau)
        contact = np.concatenate(rows.contact)
        t: Array = np.arange(len(q), dtype=np.float64) * compiled.settings.timestep
        spec = self._arm.spec
        return Trace(
            joint_names=compiled.scene.joint_names,
            t=t,
            q=q,
            qd=np.concatenate(rows.qd),
            current=np.concatenate(rows.current),
            truth=self._truth(t, tau, contact, np.concatenate(rows.region)),
            meta={
                "seed": self._seed,
                "environment": "" if spec is None else spec.id,
                "model_sha256": hashlib.sha256(compiled.scene.xml.encode()).hexdigest(),
                "tauguard": importlib.metadata.version("tauguard"),
                "mujoco": mujoco.__version__,
            },
            attachments={
                "scene.xml": compiled.scene.xml,
                TARGETS: json.dumps(rows.targets),
                **compiled.scene.nominal_texts,
            },
        )

    def _truth(
        self, t: Array, tau: Array, contact: NDArray[np.void], region: NDArray[np.void]
    ) -> Truth:
        compiled = self._arm.compiled
        links = len(compiled.scene.link_bodies)
        wrenches = Wrenches.empty(len(t), links)
        touched = np.flatnonzero(contact["link"] > 0)
        link = contact["link"][touched].astype(int) - 1
        wrenches.force[touched, link] = contact["force"][touched]
        wrenches.point[touched, link] = contact["point"][touched]
        return Truth(
            tau_ext=tau,
            contact_force=contact["net_force"].copy(),
            collisions=collisions(t, wrenches, tau, []),
            payload=np.full(len(t), compiled.settings.payload_g / 1000),
            contact_link=contact["link"].astype(np.int64),
            contact_point=contact["point"].copy(),
            contact_vector=contact["force"].copy(),
            obstacle_names=tuple(r.name for r in compiled.regions),
            obstacle_poses=homogeneous(region["position"], region["quat_wxyz"]),
        )
