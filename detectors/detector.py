"""The interface that every collision detector shares: fit on traces, then one score a sample.

A detector ranks; what counts as an alarm is decided outside of it, the same way for all: a
threshold on the score and the confirmation filter
(:class:`~tauguard.detectors.thresholds.thresholded.Thresholded`), and the threshold from a rate
(:mod:`~tauguard.detectors.thresholds.rates`) or by calibration on episodes
(:mod:`~tauguard.detectors.thresholds.conformal`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.traces.trace import Trace

Array = NDArray[np.float64]


class Detector(Protocol):
    """What can be trained and asked for scores."""

    @property
    def name(self) -> str:
        """Its name in the table of detectors."""

    @property
    def settle(self) -> float:
        """Seconds at the beginning of a trace whose scores mean nothing yet."""

    @property
    def arm(self) -> ArmModel:
        """What it believes of the arm after training; ``ValueError`` before."""

    def fit(self, traces: Sequence[Trace], robot: ArmModel) -> Detector:
        """Learn from traces of one arm at one sample rate.

        Args:
            traces: with truth where collisions are in them; every detector needs collision-free
                motion, those that learn a ranking need collisions too.
            robot: what is believed of the arm before any training: nominal numbers, drive gains
                and, where known, friction.

        Returns:
            Itself.

        Raises:
            ValueError: traces that do not fit or miss what this detector needs.
        """

    def scores(self, trace: Trace) -> Array:
        """One score a sample, shape (T,): higher is more like a collision.

        Causal: a score depends on this sample and those before it.

        Raises:
            ValueError: not fitted, other joints or another sample rate than the training's.
        """


def common_interval(traces: Sequence[Trace], robot: ArmModel) -> float:
    """The sample interval of training traces [s].

    Raises:
        ValueError: no traces, joints that are not the robot's, or rates that differ (named).
    """
    check_joints(traces, robot)
    dt = float(np.median([trace.dt for trace in traces]))
    for k, trace in enumerate(traces):
        check_interval(f"trace {k}", trace, dt)
    return dt


def check_joints(traces: Sequence[Trace], robot: ArmModel) -> None:
    """Refuse traces that are none, of another arm or of fewer than two samples.

    Raises:
        ValueError: says which.
    """
    if not traces:
        raise ValueError("no traces to train on")
    joints = robot.robot.joints
    for k, trace in enumerate(traces):
        if len(trace.joint_names) != joints:
            raise ValueError(
                f"trace {k} has {len(trace.joint_names)} joints, the robot {joints}: "
                f"{', '.join(robot.robot.joint_names)}"
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
    if len(trace.t) > 1 and not 0.8 < trace.dt / dt < 1.25:
        raise ValueError(
            f"{what} has a sample every {1e3 * trace.dt:g} ms, this detector works at "
            f"{1e3 * dt:g} ms: resample the recording to that, "
            "or train a detector on recordings of its rate"
        )
