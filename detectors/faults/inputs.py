"""Faults of samples, by the limits of an arm's usual samples.

No model of the arm is needed to find a frozen bus, a stuck encoder or a missing packet. A wrong
gain or two exchanged currents look like a contact; :class:`TorqueCheck` compares the currents with
the torques that the arm's model needs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array, runs
from tauguard.detectors import _observer
from tauguard.detectors.estimation.estimator import MOTION, ArmModel, Estimator, Unknowns
from tauguard.findings import ArgumentError
from tauguard.traces.trace import Trace

#: Rate of the observer whose residual is used [1/s].
RATE = 20.0
#: Least noise of a joint, as a fraction of the largest of all joints. Without it a load, which can
#: reverse the small torque of a wrist joint, would be a fault.
LEAST_NOISE = 0.5
#: A joint's torques are a fault if the ratio of drive torque to the model's torque is below OPPOSED
#: over 0.5 s (against the motion), or outside of LEAST to MOST over 4 s. Ratios of training with
#: loads and contacts widen these limits to RATIO_MARGIN beyond them.
OPPOSED, LEAST, MOST, RATIO_MARGIN = -0.4, 0.4, 1.7, 0.4
#: By the number that the native check answers.
TEXTS = {
    14: "torque: {joint} is driven against its motion ({value:.2f} of the torque that the model "
    "needs): another sign, exchanged joints, another arm, or a push of half a second or more",
    15: "torque: {joint} is driven with {value:.2f} of the torque that the model needs: "
    "another load, gain or arm, a saturated or biased current, or a push of a second or more",
}


def torque_fault(names: Sequence[str], number: int, joint: int, value: float) -> str:
    """The text of a fault that the native check returns; ``names`` are those of the joints."""
    return TEXTS[number].format(joint=names[joint], value=value)


class TorqueCheck:
    """Compares each joint's drive torque with the torque that the model needs, over 0.5 and 4 s.

    A contact changes the ratio of the two torques while it lasts. A contact that pushes a joint
    against its drive torque for half a second cannot be distinguished from a wrong sign.
    """

    def __init__(self, arm: ArmModel, dt: float, ratios: Array | None = None) -> None:
        """Set up the state before the first sample.

        Args:
            arm: calibrated.
            dt: time between two calls of :meth:`step` [s].
            ratios: of the training traces, see :func:`torque_ratios` (default: all 1).
        """
        seen = np.ones((3, arm.robot.joints)) if ratios is None else ratios
        bounds = (
            np.minimum(OPPOSED, seen[0] - RATIO_MARGIN),
            np.minimum(LEAST, seen[1] - RATIO_MARGIN),
            np.maximum(MOST, seen[2] + RATIO_MARGIN),
        )
        noise = np.asarray(arm.noise, dtype=np.float64)
        floor = np.maximum(noise, LEAST_NOISE * noise.max())
        self._names, self._dt = arm.robot.joint_names, dt
        self.observer = Estimator(arm, RATE, dt, Unknowns.none())
        gain = np.ascontiguousarray(arm.drive_gain, dtype=np.float64)
        self.native = _observer.TorqueCheck(gain, floor, RATE, *bounds)
        self._out = np.zeros((2 + MOTION, len(noise)))

    def step(self, q: Array, qd: Array, current: Array, dt: float | None = None) -> str:
        """The fault of the torques at this sample as text, "" without a fault.

        Args:
            q: [rad], float64, shape (n,).
            qd: [rad/s], shape (n,).
            current: [A], shape (n,).
            dt: time since the last sample [s] (default: the constructor's).

        Raises:
            ArgumentError: wrong shapes or numbers that are not finite.
        """
        self.observer.step(q, qd, current, self._out, dt)
        number, joint, value = self.native.step(self._out[0], current, dt or self._dt)
        return torque_fault(self._names, number, joint, value) if number else ""

    def reset(self) -> None:
        """Forget all samples, for example after a contact, which changes the ratios."""
        self.native.reset()

    @property
    def extremes(self) -> Array:
        """Least ratio over 0.5 s, least and largest ratio over 4 s until now, shape (3, n)."""
        return np.array(self.native.extremes()).reshape(3, -1)


def torque_ratios(traces: Sequence[Trace], arm: ArmModel) -> Array:
    """Extreme ratios of drive torque to the model's torque along traces, shape (3, n).

    Rows: least over 0.5 s, least over 4 s, largest over 4 s. They are 1 for a joint whose torque
    is always too small to be judged.
    """
    found = np.ones((3, arm.robot.joints))
    for trace in traces:
        dt = trace.dt  # a median over the trace: computed once
        check = TorqueCheck(arm, dt)
        residuals = check.observer.run(trace.t, trace.q, trace.qd, trace.current).residual
        for residual, current in zip(residuals, trace.current, strict=True):
            check.native.step(residual, current, dt)
        own = check.extremes
        found = np.vstack([np.minimum(found[:2], own[:2]), np.maximum(found[2:], own[2:])])
    return found


Counts = NDArray[np.int64]

#: Largest speed of any arm's joint [rad/s]; speeds given in degrees per second exceed it.
FASTEST = 20.0
#: Time over which summed velocities are compared with the change of position [s].
SPAN = 20e-3
#: Allowed difference between the summed velocity and the change of position over SPAN, relative to
#: the summed velocity, because filters lag and time stamps jitter.
FRACTION = 0.2
#: Allowed fraction over one sample, because a time stamp may be half an interval late.
STEP_FRACTION = 0.5
#: Allowed difference beyond these fractions, as a multiple of the largest in the training traces.
MARGIN = 3.0
#: Least allowed difference [rad]: an encoder's resolution, which training at rest may not show.
RESOLUTION = 2e-4

#: Allowed difference [rad] if velocities are derivatives of the positions: no limit.
UNLIMITED = 1e6
#: Largest number of successive missing samples, which are interpolated; more of them are a gap.
LATE = 2
#: Least value of :attr:`UsualInput.odd`.
ODD = 3

#: Name and text of each fault, by the number that the native check returns.
FAULTS: dict[int, tuple[str, str]] = {
    1: ("not-finite", "the position of {joint} is {value:g}"),
    2: ("not-finite", "the velocity of {joint} is {value:g}"),
    3: ("not-finite", "the current or torque of {joint} is {value:g}"),
    4: ("not-finite", "the time is {value:g}"),
    5: ("time", "the time stamp repeats"),
    6: ("time", "the time goes back by {back:.3g} s"),
    7: ("gap", "nothing for {ms:.3g} ms"),
    8: ("rate", "samples come every {ms:.3g} ms, trained at {dt:.3g} ms"),
    9: ("range", "the velocity of {joint} is {value:.3g} rad/s"),
    10: ("range", "the current or torque of {joint} is {value:.3g}, far beyond training's largest"),
    11: ("frozen", "no signal has changed for {value:.0f} samples"),
    12: ("position", "the position of {joint} is off its velocity by {value:.2g} rad"),
    13: ("stuck", "the current or torque of {joint} stays at {value:.3g}: saturated or stuck"),
    # 14 and 15 are in torques.py
}


@dataclass(frozen=True)
class UsualInput:
    """Limits of one arm's usual samples, from motion with and without collisions."""

    joint_names: tuple[str, ...]
    dt: float  #: sample interval [s]
    longest: float  #: longest interval that is not a gap [s]
    odd: int  #: allowed number of successive intervals that differ from ``dt`` by a quarter
    repeats: int  #: allowed number of successive samples in which no signal changes
    window: int  #: number of samples over which velocities are summed
    current: Array  #: largest possible ``|current|`` [A], shape (n,)
    step: Array  #: largest ``|dq - qd dt|`` of a sample beyond STEP_FRACTION [rad], shape (n,)
    drift: Array  #: largest ``|dq - sum qd dt|`` of a window beyond FRACTION [rad], shape (n,)
    stuck: Counts  #: allowed number of successive samples with the same current, shape (n,)
    ratios: Array  #: drive torque over torque needed, see ``torques.torque_ratios``, shape (3, n)

    @classmethod
    def of(cls, traces: Sequence[Trace], arm: ArmModel | None = None) -> UsualInput:
        """Limits from training traces.

        Args:
            traces: training traces.
            arm: calibrated arm (default: limits of the torques stay the general ones).

        Raises:
            ArgumentError: no traces, or a trace of fewer than two samples.
        """
        if not traces or any(len(trace.t) < 2 for trace in traces):
            raise ArgumentError("no traces, or one of fewer than 2 samples: nothing to learn from")
        dt = float(np.median([trace.dt for trace in traces]))
        window = max(2, round(SPAN / dt))
        usual = cls(
            traces[0].joint_names,
            dt,
            max((LATE + 1.3) * dt, 1.25 * max(float(np.diff(trace.t).max()) for trace in traces)),
            max(
                ODD,
                round(SPAN / dt / 2) - 2,
                *(2 * _longest_run(_odd(trace, dt)) + 3 for trace in traces),
            ),
            # At least two, so that a repeated packet does not count as a frozen bus.
            2 + max(_longest_run(np.asarray(_same(trace).all(axis=1))) for trace in traces),
            window,
            _believable(traces, arm),
            MARGIN * np.max([_beyond(trace, 1) for trace in traces], axis=0) + RESOLUTION,
            MARGIN * np.max([_beyond(trace, window) for trace in traces], axis=0) + RESOLUTION,
            np.max([_stuck(trace) for trace in traces], axis=0),
            np.ones((3, len(traces[0].joint_names))) if arm is None else torque_ratios(traces, arm),
        )
        return usual.without_velocities() if any(map(lacks_velocities, traces)) else usual

    def without_velocities(self) -> UsualInput:
        """Limits for velocities that are derivatives of the positions: positions always agree."""
        unlimited = np.full(len(self.joint_names), UNLIMITED)
        return replace(self, step=unlimited, drift=unlimited)


def lacks_velocities(trace: Trace) -> bool:
    """Whether a trace's velocities are derivatives of its positions."""
    return trace.meta.get("velocities") == "differentiated"


def _believable(traces: Sequence[Trace], arm: ArmModel | None) -> Array:
    """Largest current that is not a fault [A], shape (n,).

    It is three times the joint's largest current plus 1 A or, if that is more, the current for
    three times the torque of the arm's strongest joint. A hard contact can load a joint that
    usually needs little torque, such as a joint with a vertical axis.
    """
    own = np.max([np.abs(trace.current).max(axis=0) for trace in traces], axis=0)
    gain = np.ones(len(own)) if arm is None else np.abs(arm.drive_gain)
    return np.asarray(np.maximum(3 * own + 1, 3 * (own * gain).max() / gain))


def _beyond(trace: Trace, window: int) -> Array:
    """Largest difference of position and summed velocity over ``window`` samples [rad], shape (n,).

    A fraction of the travel and the effect of a late velocity or time stamp are subtracted.
    """
    travel = np.diff(trace.t)[:, None] * (trace.qd[1:] + trace.qd[:-1]) / 2
    error = np.diff(trace.q, axis=0) - travel
    late = np.minimum(np.abs(np.diff(trace.t) - trace.dt), trace.dt)[:, None]
    bend = trace.dt * np.abs(np.diff(trace.qd, axis=0)) + late * np.abs(trace.qd[1:])
    fraction = STEP_FRACTION if window == 1 else FRACTION
    left = np.abs(_sums(error, window)) - fraction * np.abs(_sums(travel, window))
    return np.asarray((left - _sums(bend, window)).max(axis=0).clip(0))


def _odd(trace: Trace, dt: float) -> NDArray[np.bool_]:
    """Whether each interval is outside of 0.8 to 1.25 times ``dt``, shape (T - 1,)."""
    ratio = np.diff(trace.t) / dt
    return np.asarray((ratio <= 0.8) | (ratio >= 1.25))


def _sums(values: Array, window: int) -> Array:
    """Sums over the last ``window`` rows, fewer at the beginning, shape (T - 1, n)."""
    total = np.cumsum(values, axis=0)
    total[window:] -= total[:-window].copy()
    return np.asarray(total)


def _same(trace: Trace) -> NDArray[np.bool_]:
    """Whether each signal equals that of the sample before, shape (T - 1, 3 n)."""
    signals = np.concatenate([trace.q, trace.qd, trace.current], axis=1)
    return np.asarray(signals[1:] == signals[:-1])


def _stuck(trace: Trace) -> Counts:
    """Twice the longest run of an unchanged current, plus 3, for each joint, shape (n,)."""
    same = trace.current[1:] == trace.current[:-1]
    return np.array([2 * _longest_run(column) + 3 for column in same.T], dtype=np.int64)


def _longest_run(mask: NDArray[np.bool_]) -> int:
    """Length of the longest run of True."""
    return int(np.diff(runs(mask), axis=1).max(initial=0))


def input_fault(usual: UsualInput, number: int, joint: int, value: float) -> str:
    """The native check's answer as text: ``"frozen: no signal has changed ..."``."""
    name, text = FAULTS[number]
    who = usual.joint_names[joint] if joint >= 0 else ""
    ms, dt = 1e3 * value, 1e3 * usual.dt
    return f"{name}: " + text.format(joint=who, value=value, ms=ms, dt=dt, back=-value)


class FaultCheck:
    """Checks samples one by one for faults."""

    def __init__(self, usual: UsualInput) -> None:
        """Set up the state before the first sample."""
        self.usual = usual
        self.native = _observer.FaultCheck(
            usual.dt,
            usual.longest,
            usual.odd,
            FASTEST,
            usual.repeats,
            usual.window,
            FRACTION,
            STEP_FRACTION,
            usual.current,
            usual.step,
            usual.drift,
            usual.stuck,
        )

    def reset(self) -> None:
        """Forget all samples."""
        self.native.reset()

    def step(self, t: float, q: Array, qd: Array, current: Array) -> str | None:
        """None, or what is wrong with this sample, see :func:`input_fault`.

        Args:
            t: its time [s].
            q: [rad], float64, shape (n,).
            qd: [rad/s], shape (n,).
            current: [A], shape (n,).

        Raises:
            ArgumentError: another number of joints.
        """
        number, joint, value = self.native.step(t, q, qd, current)
        return input_fault(self.usual, number, joint, value) if number else None
