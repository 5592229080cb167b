"""Traces brought to a detector's sample interval."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.detectors.calibration.resampling import ALIKE, coarser, rows_known, samples_each
from tauguard.traces import Trace


def ramp(rows, dt):
    t = np.arange(rows) * dt
    return Trace(("a",), t, 2 * t[:, None], np.full((rows, 1), 2.0), t[:, None] ** 2)


@settings(max_examples=50, deadline=None)
@given(rate=st.floats(78, 4000), rows=st.integers(200, 900))
def test_the_interval_comes_out_alike_and_nothing_is_seen_early(rate, rows):
    trace = ramp(rows, 1 / rate)
    count = samples_each(trace, 0.01)
    slow = coarser(trace, count)
    assert 1 / ALIKE / 1.6 < slow.dt / 0.01 < ALIKE + 1e-9
    held = slow.t[rows_known(count, rows, len(slow.t))]
    after = np.arange(rows) >= count - 1
    assert (held[after] <= trace.t[after] + 1e-12).all()  # known by then
    assert (trace.t[after] - held[after] < count / rate).all()
    # The mean of a ramp over its samples.
    np.testing.assert_allclose(slow.q[:, 0], 2 * (slow.t - (count - 1) / rate / 2), atol=1e-9)


def test_too_slow_is_refused_with_what_would_work():
    with pytest.raises(ValueError, match="every 20 ms, this detector works at 10 ms: record at"):
        samples_each(ramp(50, 0.02), 0.01)
