"""Faults of samples, by the limits of an arm's usual samples.

No model of the arm is needed. A frozen bus, a stuck encoder or a missing packet shows in the
samples. A wrong gain or a swapped pair of currents does not; it looks like a contact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array, runs
from tauguard.detectors import _observer
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.faults.torques import torque_ratios
from tauguard.traces.trace import Trace

Counts = NDArray[np.int64]

#: No arm's joint turns faster [rad/s]; degrees per second do.
FASTEST = 20.0
#: Time over which summed velocities are compared with the change of position [s].
SPAN = 20e-3
#: Fraction of a joint's travel that position and velocity may differ by: filters lag, time jitters.
FRACTION = 0.2
#: The same over one sample: a time stamp may be half an interval late.
STEP_FRACTION = 0.5
#: Allowance beyond that fraction, as a multiple of the most that training shows.
MARGIN = 3.0
#: Resolution that every encoder is allowed [rad], since training at rest may show none.
RESOLUTION = 2e-4

#: Samples in a row that may be missing before it is a gap; they are interpolated.
LATE = 2
#: Intervals in a row that may be unlike training's, at least: this, or what SPAN holds of twice dt.
ODD = 3

#: By the number of the native check's answer: a name, and a text with the joint and the value.
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
}


@dataclass(frozen=True)
class UsualInput:
    """Limits of one arm's usual samples, from motion with and without collisions."""

    joint_names: tuple[str, ...]
    dt: float  #: sample interval [s]
    longest: float  #: longest interval that is not a gap [s]
    odd: int  #: intervals in a row that may be other than ``dt`` by a quarter
    repeats: int  #: samples in a row in which no signal changes
    window: int  #: samples over which velocities are summed
    current: Array  #: largest possible ``|current|`` [A], shape (n,)
    step: Array  #: ``|change of q less qd dt|`` over one sample beyond FRACTION [rad], shape (n,)
    drift: Array  #: the same over ``window`` samples [rad], shape (n,)
    stuck: Counts  #: samples in a row with one joint's current unchanged, shape (n,)
    ratios: Array  #: of torque given to torque needed, see ``torques.torque_ratios``, shape (3, n)

    @classmethod
    def of(cls, traces: Sequence[Trace], arm: ArmModel | None = None) -> UsualInput:
        """Learn what is usual from these traces.

        Args:
            traces: of training.
            arm: calibrated; without it nothing is learned of the torques.

        Raises:
            ValueError: no traces, or of fewer than two samples.
        """
        if not traces or any(len(trace.t) < 2 for trace in traces):
            raise ValueError("no traces, or one of fewer than 2 samples: nothing to learn from")
        dt = float(np.median([trace.dt for trace in traces]))
        window = max(2, round(SPAN / dt))
        return cls(
            traces[0].joint_names,
            dt,
            max((LATE + 1.3) * dt, 1.25 * max(float(np.diff(trace.t).max()) for trace in traces)),
            max(
                ODD,
                round(SPAN / dt / 2) - 2,
                *(2 * _longest_run(_odd(trace, dt)) + 3 for trace in traces),
            ),
            # At least two, so that a packet that comes twice is not taken for a frozen bus.
            2 + max(_longest_run(np.asarray(_same(trace).all(axis=1))) for trace in traces),
            window,
            _believable(traces, arm),
            MARGIN * np.max([_beyond(trace, 1) for trace in traces], axis=0) + RESOLUTION,
            MARGIN * np.max([_beyond(trace, window) for trace in traces], axis=0) + RESOLUTION,
            np.max([_stuck(trace) for trace in traces], axis=0),
            np.ones((3, len(traces[0].joint_names))) if arm is None else torque_ratios(traces, arm),
        )


def _believable(traces: Sequence[Trace], arm: ArmModel | None) -> Array:
    """Largest current that is not a fault [A], shape (n,).

    Three times the joint's largest current, or the current that gives three times the torque of
    the arm's strongest joint. A joint that needs little torque, such as one about a vertical
    axis, still feels a hard contact fully.
    """
    own = np.max([np.abs(trace.current).max(axis=0) for trace in traces], axis=0)
    gain = np.ones(len(own)) if arm is None else np.abs(arm.drive_gain)
    return np.asarray(np.maximum(3 * own + 1, 3 * (own * gain).max() / gain))


def _beyond(trace: Trace, window: int) -> Array:
    """Most that position and velocity differ by over ``window`` samples, beyond what is allowed.

    Allowed are a fraction of the travel and the effect of a late velocity or time stamp. Shape
    (n,).
    """
    travel = np.diff(trace.t)[:, None] * (trace.qd[1:] + trace.qd[:-1]) / 2
    error = np.diff(trace.q, axis=0) - travel
    late = np.minimum(np.abs(np.diff(trace.t) - trace.dt), trace.dt)[:, None]
    bend = trace.dt * np.abs(np.diff(trace.qd, axis=0)) + late * np.abs(trace.qd[1:])
    fraction = STEP_FRACTION if window == 1 else FRACTION
    left = np.abs(_sums(error, window)) - fraction * np.abs(_sums(travel, window))
    return np.asarray((left - _sums(bend, window)).max(axis=0).clip(0))


def _odd(trace: Trace, dt: float) -> NDArray[np.bool_]:
    """Which intervals are other than ``dt`` by a quarter, shape (T - 1,)."""
    ratio = np.diff(trace.t) / dt
    return np.asarray((ratio <= 0.8) | (ratio >= 1.25))


def _sums(values: Array, window: int) -> Array:
    """Sums over ``window`` rows, at the beginning over those that exist, shape (T - 1, n)."""
    total = np.cumsum(values, axis=0)
    total[window:] -= total[:-window].copy()
    return np.asarray(total)


def _same(trace: Trace) -> NDArray[np.bool_]:
    """Which signals are those of the sample before, shape (T - 1, 3 n)."""
    signals = np.concatenate([trace.q, trace.qd, trace.current], axis=1)
    return np.asarray(signals[1:] == signals[:-1])


def _stuck(trace: Trace) -> Counts:
    """Longest run of an unchanged current a joint, doubled, plus 3, shape (n,)."""
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
        """Begin before the first sample."""
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
        """Forget the samples so far."""
        self.native.reset()

    def step(self, t: float, q: Array, qd: Array, current: Array) -> str | None:
        """None, or what is wrong with this sample, see :func:`input_fault`.

        Args:
            t: its time [s].
            q: [rad], float64, shape (n,).
            qd: [rad/s], shape (n,).
            current: [A], shape (n,).

        Raises:
            ValueError: another number of joints.
        """
        number, joint, value = self.native.step(t, q, qd, current)
        return input_fault(self.usual, number, joint, value) if number else None
