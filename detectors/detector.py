"""The protocol of a detection method: fit on traces, then one score a sample, in batch or online.

A method ranks samples. What counts as an alarm is decided outside of it, in the same way for all
methods: :class:`~tauguard.detectors.thresholds.alarm.CollisionAlarm` adds a threshold and a
confirmation time.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.traces.trace import Trace


class Detector(Protocol):
    """The settings of a method; it can be trained."""

    @property
    def name(self) -> str:
        """Its name in reports."""

    def fit(self, traces: Sequence[Trace], arm: ArmModel) -> FittedDetector:
        """Learn from traces of one arm at one sample rate.

        Args:
            traces: with truth where collisions are in them; every method needs collision-free
                motion, those that learn a ranking need collisions too.
            arm: the model before training: nominal numbers, drive gains and, where known, friction.

        Raises:
            ValueError: traces that do not fit or lack what this method needs.
        """


class FittedDetector(Protocol):
    """A trained method: complete and immutable.

    A frozen dataclass of numbers, text, arrays, tuples and other such dataclasses can be written
    into a model file.
    """

    @property
    def name(self) -> str:
        """The method's name."""

    @property
    def arm(self) -> ArmModel:
        """The arm model after training."""

    @property
    def dt(self) -> float:
        """Sample interval of the training traces [s]."""

    @property
    def settle(self) -> float:
        """Seconds at the beginning of a trace whose scores mean nothing."""

    def scores(self, trace: Trace) -> Array:
        """One score a sample, shape (T,): higher is more like a collision.

        Causal: a score depends on this sample and those before it.

        Raises:
            ValueError: other joints or another sample rate than the training's.
        """

    def stream(self) -> ScoreStream:
        """The same scores sample by sample, from the next sample on."""


class ScoreStream(Protocol):
    """The scores of one recording as its samples come in."""

    def step(self, q: Array, qd: Array, current: Array, dt: float | None = None) -> float:
        """The score of this sample, equal to that of :meth:`FittedDetector.scores`.

        Args:
            q: [rad], float64, shape (n,).
            qd: [rad/s], shape (n,).
            current: [A], shape (n,).
            dt: time since the last sample [s] (default: the training's interval).

        Raises:
            ValueError: wrong shapes or numbers that are not finite.
        """


def common_interval(traces: Sequence[Trace], arm: ArmModel) -> float:
    """The sample interval of training traces [s].

    Raises:
        ValueError: no traces, joints that are not the arm's, or rates that differ (named).
    """
    check_joints(traces, arm)
    dt = float(np.median([trace.dt for trace in traces]))
    for k, trace in enumerate(traces):
        check_interval(f"trace {k}", trace, dt)
    return dt


def check_joints(traces: Sequence[Trace], arm: ArmModel) -> None:
    """Refuse an empty list, traces of another arm and traces of fewer than two samples.

    Raises:
        ValueError: says which.
    """
    if not traces:
        raise ValueError("no traces to train on")
    joints = arm.robot.joints
    for k, trace in enumerate(traces):
        if len(trace.joint_names) != joints:
            raise ValueError(
                f"trace {k} has {len(trace.joint_names)} joints, the robot {joints}: "
                f"{', '.join(arm.robot.joint_names)}"
            )
        if len(trace.t) < 2:
            raise ValueError(f"trace {k} has {len(trace.t)} samples: expected 2 or more")


def check_trace(trace: Trace, joints: int, dt: float) -> None:
    """Refuse a trace of another arm or at another rate than training's.

    Raises:
        ValueError: says what the trace has and what the detector works with.
    """
    if len(trace.joint_names) != joints:
        raise ValueError(f"the trace has {len(trace.joint_names)} joints, this detector {joints}")
    check_interval("the trace", trace, dt)


def check_interval(what: str, trace: Trace, dt: float) -> None:
    """Refuse a trace that is not sampled every ``dt`` seconds, to a quarter.

    Raises:
        ValueError: names ``what`` and both intervals.
    """
    if len(trace.t) > 1 and not same_rate(trace.dt, dt):
        raise ValueError(
            f"{what} has a sample every {1e3 * trace.dt:g} ms, this detector works at "
            f"{1e3 * dt:g} ms: resample the recording to that, "
            "or train a detector on recordings of its rate"
        )


def same_rate(dt: float, trained: float) -> bool:
    """Whether two sample intervals are equal to a quarter."""
    return 0.8 < dt / trained < 1.25
