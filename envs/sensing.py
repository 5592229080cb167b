"""A detector in the loop of an environment: it sees what the sensors measure, sample by sample."""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tauguard.detectors import CollisionDetector, MomentumObserver, RobotNumbers
from tauguard.envs.actions import observation_table
from tauguard.envs.settings import DETECTORS
from tauguard.envs.world import World
from tauguard.models import Drive, cura6_drive, pin_model

Array = NDArray[np.float64]

#: The plain detector's thresholds: times the breakaway friction, plus a share of the torque limit.
FRICTION_SHARE, TORQUE_SHARE = 1.5, 0.03
#: An arm without torque limits gets this threshold [N m].
PLAIN_THRESHOLD = 5.0
#: Slope of the nominal friction around standstill [rad/s].
STANDSTILL = 0.05


class Detector(Protocol):
    """What an environment asks of a detector.

    One that also has ``steps(q, qd, current)`` for samples of shape (T, n), which returns residuals
    (T, n) and alarms (T,), is called once an action; ``settings.settle`` [s] is how long it is
    silent after a reset.
    """

    def step(self, q: Array, qd: Array, current: Array) -> bool:
        """Judge one sample, arrays of shape (n,): whether the alarm is up."""
        ...

    def reset(self) -> None:
        """Begin anew."""
        ...


class ObserverDetector:
    """The momentum observer with fixed thresholds: nothing is trained, so any arm can have it.

    Friction is compensated by its nominal Coulomb and viscous part; what static friction may hide
    decides the threshold. A trained detector is several times as sensitive.
    """

    def __init__(self, robot: RobotNumbers, drive: Drive, dt: float, gain: float = 50.0) -> None:
        """Take the nominal numbers.

        Args:
            robot: nominal rigid body.
            drive: nominal drive.
            dt: of the samples [s].
            gain: of the observer [1/s].
        """
        self._observer = MomentumObserver(robot, gain, dt)
        self._robot, self._gain, self._dt, self._drive = robot, gain, dt, drive
        limit = np.where(np.isfinite(drive.torque_limit), drive.torque_limit, np.nan)
        share = TORQUE_SHARE * limit
        if drive.friction is not None:
            share = share + FRICTION_SHARE * drive.friction.static
        self.threshold = np.where(np.isfinite(share), share, PLAIN_THRESHOLD)
        self.residual = np.zeros(robot.joints)

    def reset(self) -> None:
        """Begin anew."""
        self._observer = MomentumObserver(self._robot, self._gain, self._dt)
        self.residual = np.zeros(self._robot.joints)

    def step(self, q: Array, qd: Array, current: Array) -> bool:
        """Judge one sample: whether a residual exceeds its threshold."""
        return bool(self.steps(q[None], qd[None], current[None])[1][0])

    def steps(self, q: Array, qd: Array, current: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Judge samples of shape (T, n) in turn: residuals [N m], and alarms of shape (T,)."""
        tau = self._drive.gain * current
        friction = self._drive.friction
        if friction is not None:
            tau = tau - friction.coulomb * np.tanh(qd / STANDSTILL) - friction.viscous * qd
        residuals, step = np.empty_like(q), self._observer.step
        for row in range(len(q)):
            step(q[row], qd[row], tau[row], out=residuals[row])
        self.residual = residuals[-1]
        alarms: NDArray[np.bool_] = np.any(np.abs(residuals) > self.threshold, axis=1)
        return residuals, alarms


class _PerArm:
    """One detector an arm, for scenes with several; joints of the arms follow one another."""

    def __init__(self, parts: list[Any]) -> None:
        self.parts = parts

    @property
    def residual(self) -> Array:
        return np.concatenate([part.residual for part in self.parts])

    def reset(self) -> None:
        for part in self.parts:
            part.reset()

    def step(self, q: Array, qd: Array, current: Array) -> bool:
        n = len(q) // len(self.parts)
        cuts = [slice(k * n, (k + 1) * n) for k in range(len(self.parts))]
        found = [p.step(q[c], qd[c], current[c]) for p, c in zip(self.parts, cuts, strict=True)]
        return any(found)


def make_detector(world: World, wanted: object) -> Detector | None:
    """A fresh detector for one copy of ``world``: by name, from a model file, or a copy of one.

    Raises:
        ValueError: nothing that can detect, or a model file of another arm.
    """
    if wanted is None:
        return None
    if isinstance(wanted, str) and wanted in DETECTORS:
        parts = [ObserverDetector(*part, world.settings.timestep) for part in _arms(world)]
        return parts[0] if len(parts) == 1 else _PerArm(parts)
    if isinstance(wanted, str):
        try:
            wanted = CollisionDetector.load(wanted)
        except ValueError as error:
            raise ValueError(f"detector {error}") from None
    if not (hasattr(wanted, "step") and hasattr(wanted, "reset")):
        raise ValueError(
            f"detector: {type(wanted).__name__} has no step and reset; expected "
            f"{', '.join(DETECTORS)}, the path of a trained srq-svr detector, or an object with "
            "step(q, qd, current) and reset()"
        )
    if isinstance(wanted, CollisionDetector):
        joints = wanted.arm.robot.joints if wanted.arm else 0
        if joints != len(world.scene.joint_names):
            raise ValueError(
                f"detector: trained on {joints} joints, the scene has "
                f"{len(world.scene.joint_names)}; train one on this arm"
            )
        wanted.reset()
    fresh: Detector = copy.deepcopy(wanted)
    return fresh


def _arms(world: World) -> list[tuple[RobotNumbers, Drive]]:
    """Nominal numbers of each arm; the second one looks the other way, which gravity cannot see."""
    robot = RobotNumbers.from_pin(pin_model(world.scene.arm_xml))
    drive = cura6_drive() if world.settings.robot == "cura6" else world.nominal
    if world.settings.ideal_drive:
        drive = replace(drive, friction=None)
    return [(robot, drive)] * world.arms


class Sensing:
    """The sensors of one copy of a world, and the detector that listens to them.

    Attributes:
        measured: q, qd and current at every physics step of the last action, (substeps, n) each.
        residuals: of the detector [N m], shape (substeps, n).
        alarms: shape (substeps,).
    """

    def __init__(self, world: World, detector: Detector | None) -> None:
        """Keep the parts."""
        self._sensors = world.scene.drive.sensors
        self._gain = world.nominal.gain
        self.detector = detector
        #: The detector is silent for this long after a reset [s], as a trained one is.
        self.settle = float(getattr(getattr(detector, "settings", None), "settle", 0.0))
        table = observation_table(world)
        self._low = np.array([entry.low for entry in table])
        self._high = np.array([entry.high for entry in table])
        self._none = np.zeros(len(world.scene.joint_names))
        steps = world.settings.substeps
        self.residuals = np.zeros((steps, len(self._none)))
        self.alarms = np.zeros(steps, dtype=np.bool_)
        self.measured = (self.residuals, self.residuals, self.residuals)

    def reset(self) -> None:
        """A new episode."""
        if self.detector is not None:
            self.detector.reset()

    def measure(
        self, rng: np.random.Generator, q: Array, qd: Array, current: Array
    ) -> tuple[Array, Array, Array]:
        """What the sensors say of true signals, shape (substeps, n) each."""
        self.measured = (
            (q, qd, current)
            if self._sensors is None
            else self._sensors.measure(rng, q, qd, current)
        )
        return self.measured

    def detect(self, q: Array, qd: Array, current: Array) -> tuple[Array, bool]:
        """Residual at the last sample [N m], and whether the alarm was up at any."""
        if self.detector is None:
            return self._none, False
        steps = getattr(self.detector, "steps", None)
        if steps is not None:  # all samples of the action in one call
            self.residuals[:], self.alarms[:] = steps(q, qd, current)
            return self.residuals[-1], bool(self.alarms.any())
        for row in range(len(q)):
            self.alarms[row] = self.detector.step(q[row], qd[row], current[row])
            self.residuals[row] = getattr(self.detector, "residual", self._none)
        return self.residuals[-1], bool(self.alarms.any())

    def show(self, observation: Array, q: Array, qd: Array, current: Array) -> None:
        """Put the last measured sample into an observation."""
        n = q.shape[1]
        observation[:n], observation[n : 2 * n] = q[-1], qd[-1]
        observation[2 * n : 3 * n] = self._gain * current[-1]
        np.clip(observation, self._low, self._high, out=observation)
