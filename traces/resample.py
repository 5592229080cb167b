"""A trace at a lower sample rate, as a controller of that rate would have logged it."""

from dataclasses import replace

import numpy as np

from tauguard.arrays import Array
from tauguard.findings import ArgumentError
from tauguard.traces.trace import Trace, Truth


def resampled(trace: Trace, hz: float) -> Trace:
    """The trace with a sample every 1 / ``hz`` seconds.

    A robot samples its sensors at an instant, so positions, velocities, currents and commands are
    interpolated. True torques are averaged over the interval that ends at a sample, so no impulse
    is lost or counted twice. Contact force, link and point are those of the largest force in this
    interval. Collisions keep their times; reported contacts are omitted.

    Args:
        trace: Two samples or more.
        hz: The new rate, at most the rate of the trace [Hz].

    Raises:
        ArgumentError: a rate that is not above 0 or exceeds the rate of the trace, or a trace that
            ends before the second sample.
    """
    if not (hz > 0 and len(trace.t) > 1 and hz * trace.dt < 1.01):
        own = f"at {1 / trace.dt:g} Hz" if len(trace.t) > 1 else f"of {len(trace.t)} samples"
        raise ArgumentError(
            f"hz {hz:g} for a trace {own}: expected above 0 and at most the rate of the trace"
        )
    t = np.arange(trace.t[0], trace.t[-1] + 1e-9, 1 / hz)
    if len(t) < 2:
        raise ArgumentError(f"hz {hz:g}: the trace ends before the second sample")

    def at(values: Array) -> Array:
        return np.column_stack([np.interp(t, trace.t, column) for column in values.T])

    return replace(
        trace,
        t=t,
        truth=None if trace.truth is None else _truth(trace.truth, trace.t, t),
        contacts=(),
        **{name: at(values) for name, values in trace.signals.items()},  # type: ignore[arg-type]
    )


def averaged(trace: Trace, hz: float) -> Trace:
    """The trace at ``hz``; each sample is the mean over the interval that ends at it.

    Averaging limits aliasing and delays all signals by half an interval. No sample depends on later
    ones.

    Args:
        trace: A trace without truth.
        hz: The new rate, at most the rate of the trace [Hz].

    Raises:
        ArgumentError: as :func:`resampled`, or a trace with truth.
    """
    if trace.truth is not None:
        raise ArgumentError(
            "trace: it has truth, expected none; averaged signals would lag behind the labels"
        )
    thin = resampled(trace, hz)
    means = {name: _averaged(x, trace.t, thin.t) for name, x in trace.signals.items()}
    return replace(thin, **means)  # type: ignore[arg-type]


def _truth(truth: Truth, t: Array, new: Array) -> Truth:
    """The truth with averaged torques, and with the contact of the largest force per interval."""
    ends = np.searchsorted(t, new + 1e-9)
    begins = np.minimum(np.concatenate(([0], ends[:-1])), ends - 1)
    force = truth.contact_force
    rows = np.array([b + force[b:e].argmax() for b, e in zip(begins, ends, strict=True)])
    poses = truth.obstacle_poses
    return replace(
        truth,
        tau_ext=_averaged(truth.tau_ext, t, new),
        contact_force=force[rows],
        payload=truth.payload[ends - 1],
        contact_link=truth.contact_link[rows],
        contact_point=truth.contact_point[rows],
        contact_vector=truth.contact_vector[rows],
        obstacle_poses=poses[ends - 1] if len(poses) else poses,
    )


def _averaged(values: Array, t: Array, new: Array) -> Array:
    """Means over the intervals that end at ``new``; the first row is kept."""
    pieces = (values[1:] + values[:-1]) / 2 * np.diff(t)[:, None]
    area = np.concatenate([np.zeros_like(values[:1]), pieces.cumsum(axis=0)])
    upto = np.column_stack([np.interp(new, t, column) for column in area.T])
    return np.concatenate([values[:1], np.diff(upto, axis=0) / np.diff(new)[:, None]])
