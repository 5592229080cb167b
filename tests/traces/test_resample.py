"""A trace at a lower rate: signals at instants, torques without loss."""

import numpy as np
import pytest

from tauguard.traces import Collision, Trace, Truth, resampled


@pytest.fixture
def trace():
    t = 2.0 + np.arange(1001) * 1e-3
    q = np.column_stack([np.sin(3 * t), t**2])
    torque = np.zeros((1001, 2))
    torque[300:303] = [40.0, -7.0]  # an impact of 3 ms, between two samples of a slow log
    force, link = np.zeros(1001), np.zeros(1001, dtype=np.int64)
    force[300:303], link[300:303] = (50.0, 90.0, 60.0), (2, 4, 3)
    truth = Truth(
        torque,
        force,
        (Collision("strike", 2.3, 2.303, 4, np.zeros(3), np.zeros(3), 40.0),),
        np.where(t < 2.5, 0.0, 1.5),
        link,
        np.zeros((1001, 3)),
        np.zeros((1001, 3)),
    )
    return Trace(("a", "b"), t, q, np.gradient(q, 1e-3, axis=0), q + 1, q_des=q - 1, truth=truth)


@pytest.mark.parametrize("hz", [23.8, 100.0, 125.0, 1000.0])
def test_signals_are_those_of_the_instants_and_no_impulse_is_lost(trace, hz):
    slow = resampled(trace, hz)
    np.testing.assert_allclose(np.diff(slow.t), 1 / hz, rtol=1e-9)
    # Linear interpolation of a curve with a second derivative of at most 9 over 1 ms.
    np.testing.assert_allclose(slow.q[:, 0], np.sin(3 * slow.t), atol=9 * 1e-6 / 8)
    np.testing.assert_allclose(slow.current, slow.q + 1, atol=1e-12)
    np.testing.assert_allclose(slow.q_des, slow.q - 1, atol=1e-12)
    assert (slow.truth.tau_ext.sum(axis=0) / hz) == pytest.approx([0.12, -0.021], rel=1e-6)
    assert slow.truth.contact_force.max() == 90.0
    assert slow.truth.contact_link[slow.truth.contact_force.argmax()] == 4
    assert slow.truth.collisions == trace.truth.collisions
    before = slow.t < 2.5 - 1e-6
    assert (slow.truth.payload == np.where(before, 0.0, 1.5)).all()


@pytest.mark.parametrize("hz", [0.0, -1.0, 2000.0, np.nan])
def test_rates_that_cannot_be_are_refused(trace, hz):
    with pytest.raises(ValueError, match="expected above 0 and at most the rate of the trace"):
        resampled(trace, hz)


def test_a_trace_that_is_too_short_is_named(trace):
    with pytest.raises(ValueError, match="ends before the second sample"):
        resampled(trace, 0.5)
