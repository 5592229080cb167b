"""A detector in the loop of an environment; it reads the measured signals sample by sample."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Protocol

import numpy as np

from tauguard.arrays import Array, Bools
from tauguard.detectors import CollisionAlarm, Estimator, MomentumObserver, RobotNumbers
from tauguard.detectors.alarms.monitor import Monitor
from tauguard.detectors.dynamics.same_arm import arm_difference
from tauguard.detectors.estimation.estimator import MOTION, Unknowns
from tauguard.detectors.estimation.observer import ENVIRONMENT_GAIN, PLAIN_GAIN
from tauguard.detectors.samples import same_rate
from tauguard.envs.gym.actions import observation_table
from tauguard.envs.gym.compiled import CompiledScene
from tauguard.envs.gym.settings import DETECTORS
from tauguard.findings import ArgumentError
from tauguard.models import Drive, pin_model
from tauguard.models.left_over import Player

#: The threshold of the detector "observer" is the sum of these multiples of the static friction and
#: of the torque limit.
FRICTION_FACTOR, TORQUE_FACTOR = 1.5, 0.03
#: Threshold at a joint without a torque limit [N m].
PLAIN_THRESHOLD = 5.0
#: Largest residual without contact for a trained detector [standard deviations].
SIGMAS = 3.0
#: The nominal friction changes its sign smoothly, as tanh of the speed divided by this [rad/s].
STANDSTILL = 0.05
#: Within this distance of an end of its range a joint is treated as touching its stop [rad].
MARGIN = 0.005
#: Time after which a stop no longer affects the residual [time constants of the observer].
FORGOTTEN = 15.0


class Listener(Protocol):
    """A detector in one copy of an environment; each episode has a new one."""

    @property
    def name(self) -> str:
        """The detector's name."""

    @property
    def fault(self) -> str:
        """The fault found in the samples of the last :meth:`steps`; "" if none was found."""

    @property
    def bounds(self) -> Array:
        """Largest residual without contact [N m], shape (n,)."""

    def steps(self, q: Array, qd: Array, current: Array) -> tuple[Array, Bools]:
        """Process samples of shape (T, n); returns residuals (T, n) [N m] and alarms (T,)."""
        ...

    def get_state(self) -> Any:
        """The detector's state, for :meth:`set_state`."""
        ...

    def set_state(self, state: Any) -> None:
        """Restore what :meth:`get_state` returned."""


class ObserverListener:
    """The momentum observer with fixed thresholds. It needs no training, so it fits any arm.

    The nominal Coulomb and viscous friction is compensated. The threshold follows from the static
    friction and the torque limit. A trained detector is several times as sensitive.

    The stop of a joint exerts a torque on this joint alone. The joint's residual therefore counts
    as zero while the joint is near an end of its range, and until the observer has forgotten the
    stop. In that time a collision is detected only if another joint's residual shows it.
    """

    name, fault = "observer", ""

    def __init__(
        self,
        robot: RobotNumbers,
        drive: Drive,
        dt: float,
        gain: float = ENVIRONMENT_GAIN,
        ranges: Array | None = None,
    ) -> None:
        """Take the nominal numbers.

        Args:
            robot: nominal rigid body.
            drive: nominal drive.
            dt: sample interval [s].
            gain: gain of the observer [1/s].
            ranges: joint ranges [rad], (n, 2); default: no joint has a stop.
        """
        self._observer, self._drive = MomentumObserver(robot, gain, dt), drive
        limit = np.where(np.isfinite(drive.torque_limit), drive.torque_limit, np.nan)
        bounds, none = TORQUE_FACTOR * limit, np.zeros(robot.joints)
        friction = drive.friction
        if friction is not None:
            bounds = bounds + FRICTION_FACTOR * friction.static
        self.bounds: Array = np.where(np.isfinite(bounds), bounds, PLAIN_THRESHOLD)
        coulomb, viscous = (friction.coulomb, friction.viscous) if friction else (none, none)
        low, high = (none - np.inf, none + np.inf) if ranges is None else ranges.T
        self._numbers = np.array(
            [drive.gain, coulomb, viscous, low + MARGIN, high - MARGIN, self.bounds]
        )
        self._hold = round(FORGOTTEN / (gain * dt))
        #: Number of samples for which each joint's residual still counts as zero, shape (n,).
        self._left = np.zeros(robot.joints, dtype=np.int64)

    def steps(self, q: Array, qd: Array, current: Array) -> tuple[Array, Bools]:
        """See :class:`Listener`; the alarm is true where a residual exceeds its bound."""
        residuals, alarms = np.empty(q.shape), np.empty(len(q), dtype=np.bool_)
        direction = np.tanh(qd / STANDSTILL)
        signals, own = (q, qd, direction, current), self._observer
        own.native.alarms(
            *signals, self._numbers, own.dt, self._hold, self._left, residuals, alarms
        )
        return residuals, alarms

    def get_state(self) -> Any:
        """See :class:`Listener`."""
        return self._observer.get_state(), self._left.copy()

    def set_state(self, state: Any) -> None:
        """See :class:`Listener`."""
        self._observer.set_state(state[0])
        self._left = state[1].copy()


class AlarmListener:
    """A trained detector with its threshold; the residual is the momentum observer's."""

    def __init__(self, alarm: CollisionAlarm) -> None:
        """Start before the first sample."""
        arm = alarm.detector.arm
        self.name = alarm.detector.name
        self.bounds: Array = SIGMAS * np.asarray(arm.noise)
        self._dt, self._count = alarm.detector.dt, 0
        #: For a model that checks its input: finds faults, and runs the detector itself.
        self._monitor = Monitor(alarm, alarm.inputs) if alarm.inputs is not None else None
        self._alarm = alarm.stream() if self._monitor is None else None
        self._observer = Estimator(arm, PLAIN_GAIN, alarm.detector.dt, Unknowns.none())
        self._last = np.zeros(arm.robot.joints)
        self.fault = ""
        #: The samples so far: a snapshot that was stored on disk is restored from them.
        self._samples: list[tuple[Array, Array, Array]] = []

    def steps(self, q: Array, qd: Array, current: Array) -> tuple[Array, Bools]:
        """See :class:`Listener`; if a sample is not finite, the residual keeps its last value."""
        residuals, alarms = np.empty(q.shape), np.zeros(len(q), dtype=np.bool_)
        self._samples.append((q.copy(), qd.copy(), current.copy()))
        if self._monitor is not None:
            t = self._dt * np.arange(self._count, self._count + len(q), dtype=np.float64)
            self._count += len(q)
            signals = (q, qd, current)
            self.fault = self._monitor.steps(
                t, signals, self._observer, self._last, residuals, alarms
            )
            return residuals, alarms
        out = np.empty((2 + MOTION, q.shape[1]))
        assert self._alarm is not None
        for row, sample in enumerate(zip(q, qd, current, strict=True)):
            alarms[row] = self._alarm.step(*sample)
            self._observer.step(*sample, out)
            residuals[row] = out[0]
        return residuals, alarms

    def get_state(self) -> Any:
        """See :class:`Listener`."""
        return Remembered(tuple(self._samples), self._copies(), self._last.copy(), self.fault)

    def set_state(self, state: Any) -> None:
        """See :class:`Listener`; a state from a file takes the time of its samples."""
        if state.native is None:
            for sample in state.samples:
                self.steps(*sample)
            return
        stream, self._observer.native = (part.copy() for part in state.native)
        if self._monitor is not None:
            self._monitor.native = stream
        else:
            assert self._alarm is not None
            self._alarm.native = stream
        self._samples, self._last, self.fault = list(state.samples), state.last.copy(), state.fault
        self._count = sum(len(sample[0]) for sample in self._samples)

    def _copies(self) -> tuple[Any, Any]:
        stream = self._alarm if self._monitor is None else self._monitor
        assert stream is not None
        return stream.native.copy(), self._observer.native.copy()


@dataclass(frozen=True)
class Remembered:
    """The state of a trained detector. A pickle has the samples only, which lead to this state."""

    samples: tuple[tuple[Array, Array, Array], ...]
    native: tuple[Any, Any] | None
    last: Array
    fault: str

    def __getstate__(self) -> dict[str, Any]:
        """The fields without native objects."""
        return vars(self) | {"native": None}


class PerArm:
    """One listener per arm; the joints of the arms follow one another."""

    def __init__(self, parts: Sequence[Listener]) -> None:
        """Take the listeners of the arms, in order."""
        self._parts = parts
        self.name, self.fault = parts[0].name, ""
        self.bounds: Array = np.concatenate([part.bounds for part in parts])

    def steps(self, q: Array, qd: Array, current: Array) -> tuple[Array, Bools]:
        """See :class:`Listener`."""
        n = q.shape[1] // len(self._parts)
        found = [
            part.steps(*(np.ascontiguousarray(x[:, k * n : k * n + n]) for x in (q, qd, current)))
            for k, part in enumerate(self._parts)
        ]
        residuals, alarms = zip(*found, strict=True)
        self.fault = next((part.fault for part in self._parts if part.fault), "")
        return np.concatenate(residuals, axis=1), np.any(alarms, axis=0)

    def get_state(self) -> Any:
        """See :class:`Listener`."""
        return [part.get_state() for part in self._parts]

    def set_state(self, state: Any) -> None:
        """See :class:`Listener`."""
        for part, own in zip(self._parts, state, strict=True):
            part.set_state(own)


def listener_factory(compiled: CompiledScene, wanted: object) -> Callable[[], Listener] | None:
    """A function that makes the detector of a copy; None without a detector.

    Args:
        compiled: the scene.
        wanted: a name, the path of a model file, a ``CollisionAlarm``, or None.

    Raises:
        ArgumentError: ``wanted`` is no detector, or was trained on another arm or sample rate.
    """
    if wanted is None:
        return None
    if isinstance(wanted, str) and wanted in DETECTORS:
        n, dt, arms = len(compiled.scene.facts.joints), compiled.settings.timestep, _arms(compiled)
        ranges = [compiled.joint_range[k * n : (k + 1) * n] for k in range(compiled.arms)]

        def observers() -> Listener:
            parts = [
                ObserverListener(*arm, dt, ranges=r) for arm, r in zip(arms, ranges, strict=True)
            ]
            return parts[0] if len(parts) == 1 else PerArm(parts)

        return observers
    if isinstance(wanted, str):
        from tauguard.detectors import load_model  # imports scikit-learn, which takes long

        try:
            wanted = load_model(wanted)
        except ValueError as error:
            raise ArgumentError(f"detector {error}") from None
    if not isinstance(wanted, CollisionAlarm):
        raise ArgumentError(
            f"detector: a {type(wanted).__name__}; expected {', '.join(DETECTORS)}, the path of a "
            "trained detector, or a tauguard.detectors.CollisionAlarm"
        )
    return partial(AlarmListener, _fitting(compiled, wanted))


def _fitting(compiled: CompiledScene, alarm: CollisionAlarm) -> CollisionAlarm:
    """Check that the alarm is of the scene's arm and sample rate; returns it."""
    joints, own = alarm.detector.arm.robot.joints, len(compiled.scene.joint_names)
    if joints != own:
        raise ArgumentError(
            f"detector: trained on {joints} joints, the scene has {own}; train one on this arm"
        )
    if compiled.arms == 1:
        numbers = RobotNumbers.from_pin(pin_model(compiled.scene.arm_model))
        if difference := arm_difference(numbers, alarm.detector.arm.robot):
            file = "another arm" if alarm.robot is None else f"the arm of {alarm.robot.name}"
            raise ArgumentError(f"detector: trained on {file}: {difference}; train one on this arm")
    if not same_rate(compiled.settings.timestep, alarm.detector.dt):
        raise ArgumentError(
            f"detector: needs a sample every {1e3 * alarm.detector.dt:g} ms, but the scene's time "
            f"step is {1e3 * compiled.settings.timestep:g} ms; train one at this rate"
        )
    return alarm


def _arms(compiled: CompiledScene) -> list[tuple[RobotNumbers, Drive]]:
    """Nominal numbers of each arm. All are equal: turning about the vertical changes none."""
    robot = RobotNumbers.from_pin(pin_model(compiled.scene.arm_model))
    drive = compiled.scene.facts.nominal
    if compiled.settings.ideal_drive:
        drive = replace(drive, friction=None)
    return [(robot, drive)] * compiled.arms


class Sensing:
    """The sensors of one copy of a compiled scene, and the detector that reads them.

    Attributes:
        measured: q, qd and current at every physics step of the last action, (substeps, n) each.
        residuals: the detector's residual in the last action [N m], shape (substeps, n).
        alarms: the detector's alarm in the last action, shape (substeps,).
        sensors: model of the sensors' errors; None: no errors.
    """

    def __init__(self, compiled: CompiledScene, make: Callable[[], Listener] | None) -> None:
        """Set up the sensors; ``make`` makes the detector of an episode, None: no detector."""
        self.sensors = compiled.scene.drive.sensors
        self._gain = compiled.nominal.gain
        self._dt = float(compiled.scene.model.opt.timestep)
        self._player: Player | None = None
        self._make = make
        self.detector = make() if make else None
        table = observation_table(compiled)[: 3 * len(compiled.scene.joint_names)]
        self._low = np.array([entry.low for entry in table])
        self._high = np.array([entry.high for entry in table])
        self._none = np.zeros(len(compiled.scene.joint_names))
        steps = compiled.settings.substeps
        self.residuals = np.zeros((steps, len(self._none)))
        self.alarms = np.zeros(steps, dtype=np.bool_)
        self.measured = (self.residuals, self.residuals, self.residuals)

    def reset(self) -> None:
        """Begin a new episode."""
        self._player = None
        self.detector = self._make() if self._make else None

    @property
    def fault(self) -> str:
        """The fault that the detector found in the last action's samples; "" if it found none."""
        return self.detector.fault if self.detector else ""

    @property
    def bounds(self) -> Array:
        """Largest residual without contact [N m], shape (n,)."""
        return self.detector.bounds if self.detector else self._none

    def measure(
        self, rng: np.random.Generator, q: Array, qd: Array, current: Array
    ) -> tuple[Array, Array, Array]:
        """Measured signals from true ones, shape (substeps, n) each."""
        self.measured = (q, qd, current)
        if self.sensors is not None:
            self._player = self._player or self.sensors.player(self._dt, rng)
            self.measured = self.sensors.measure(rng, q, qd, current, self._player)
        return self.measured

    def detect(self, q: Array, qd: Array, current: Array) -> tuple[Array, bool]:
        """Residual at the last sample [N m], and whether any sample raised the alarm."""
        if self.detector is None:
            return self._none, False
        self.residuals[:], self.alarms[:] = self.detector.steps(q, qd, current)
        return self.residuals[-1], bool(self.alarms.any())

    def show(self, observation: Array, q: Array, qd: Array, current: Array) -> None:
        """Write the last measured sample into an observation."""
        n = q.shape[1]
        observation[:n], observation[n : 2 * n] = q[-1], qd[-1]
        observation[2 * n : 3 * n] = self._gain * current[-1]
        measured = observation[: 3 * n]
        np.clip(measured, self._low, self._high, out=measured)
