"""Checks of joints and sample rates, shared by all methods."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tauguard.findings import ArgumentError
from tauguard.traces.trace import Trace


def common_interval(traces: Sequence[Trace], joint_names: Sequence[str]) -> float:
    """The sample interval of training traces [s].

    Raises:
        ArgumentError: no traces, another number of joints than the arm's, or different rates.
    """
    check_joints(traces, joint_names)
    dt = float(np.median([trace.dt for trace in traces]))
    for k, trace in enumerate(traces):
        check_interval(f"trace {k}", trace, dt)
    return dt


def check_joints(traces: Sequence[Trace], joint_names: Sequence[str]) -> None:
    """Refuse an empty list, traces of another arm and traces of fewer than two samples.

    Raises:
        ArgumentError: says which.
    """
    if not traces:
        raise ArgumentError("no traces to train on")
    for k, trace in enumerate(traces):
        if len(trace.joint_names) != len(joint_names):
            raise ArgumentError(
                f"trace {k} has {len(trace.joint_names)} joints, the robot {len(joint_names)}: "
                f"{', '.join(joint_names)}"
            )
        if len(trace.t) < 2:
            raise ArgumentError(f"trace {k} has {len(trace.t)} samples: expected 2 or more")


def check_trace(trace: Trace, joints: int, dt: float) -> None:
    """Refuse a trace with another number of joints or another rate than the training's.

    Raises:
        ArgumentError: names the value of the trace and that of the detector.
    """
    if len(trace.joint_names) != joints:
        raise ArgumentError(
            f"the trace has {len(trace.joint_names)} joints, this detector {joints}"
        )
    check_interval("the trace", trace, dt)


def check_interval(what: str, trace: Trace, dt: float) -> None:
    """Refuse a trace whose sample interval differs from ``dt`` by a quarter or more.

    Raises:
        ArgumentError: names ``what`` and both intervals.
    """
    if len(trace.t) > 1 and not same_rate(trace.dt, dt):
        raise ArgumentError(
            f"{what} has a sample every {1e3 * trace.dt:g} ms, this detector works at "
            f"{1e3 * dt:g} ms: "
            + (f"resample it to that (`resample={plain_rate(dt):g}`), or " if trace.dt < dt else "")
            + "train a detector on recordings of its rate"
        )


def plain_rate(dt: float) -> float:
    """Samples per second; a number with few digits if one is within 3 %, as times jitter [Hz]."""
    hz = 1 / dt
    steps = (1,) if abs(hz - round(hz)) < 1e-4 * hz else (100, 50, 25, 10, 5, 1)
    near = (step * round(hz / step) for step in steps)
    return next((rate for rate in near if abs(rate - hz) < 0.03 * hz), hz)


def same_rate(dt: float, trained: float) -> bool:
    """Whether two sample intervals differ by less than a quarter of the shorter."""
    return 0.8 < dt / trained < 1.25
