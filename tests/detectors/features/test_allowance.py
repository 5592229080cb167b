"""The bound on what collision-free motion leaves."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.detectors.features.allowance import (
    SETTLES,
    TERMS,
    Allowance,
    held,
    peaks,
    quantile_bound,
    stirred,
    terms,
)
from tauguard.detectors.thresholds.rates import followed


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**31), quantile=st.floats(0.55, 0.95), rows=st.integers(40, 120))
def test_a_quantile_bound_covers_its_share(seed, quantile, rows):
    rng = np.random.default_rng(seed)
    x = np.column_stack([np.ones(rows), rng.uniform(0, 5, rows)])
    y = rng.exponential(1.0 + x[:, 1])
    weights = quantile_bound(x, y, quantile)
    assert (weights >= 0).all()
    covered = np.mean(y <= x @ weights + 1e-9)
    # As many lie on the bound as it has terms that are not 0.
    assert quantile - 1 / rows <= covered <= quantile + 3 / rows


def test_the_median_of_a_constant_is_the_median():
    y = np.array([3.0, 1.0, 2.0, 9.0, 4.0])
    assert quantile_bound(np.ones((5, 1)), y, 0.5) == pytest.approx(3.0)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**31), samples=st.integers(1, 30))
def test_held_is_the_largest_of_late_and_causal(seed, samples):
    x = np.random.default_rng(seed).normal(size=(60, 2))
    out = held(x, samples)
    truth = [x[max(0, k + 1 - samples) : k + 1].max(axis=0) for k in range(60)]
    np.testing.assert_array_equal(out, truth)


def test_terms_of_a_stop_last_a_while_and_then_fade():
    qd = np.concatenate([np.full(100, 1.0), np.zeros(100)])[:, None]
    acceleration = np.zeros((200, 1))
    acceleration[100] = -30.0
    x = terms(qd, acceleration, np.zeros((200, 1)), np.abs(qd) < 0.5, 0.01)
    assert x.shape == (200, 1, TERMS)
    assert (x[100:120, 0, 2] == 30).all()
    assert (x[120:, 0, 2] == 0).all()
    assert x[99, 0, 4] < 0.01 < 0.99 < x[100, 0, 4]


def test_a_motion_of_any_joint_is_forgotten_within_seconds():
    rest = np.ones((600, 2), dtype=bool)
    rest[100:200, 1] = False
    x = stirred(rest, 0.01)
    assert (x[100:200] == 1).all()
    np.testing.assert_allclose(x[199:], np.exp(-SETTLES * 0.01 * np.arange(401)), rtol=1e-12)
    np.testing.assert_array_equal(stirred(rest[:300], 0.01), x[:300])


def test_a_joint_without_peaks_gets_next_to_nothing_and_can_have_the_bound_of_another():
    left = np.abs(np.random.default_rng(0).normal(size=(3000, 2)))
    left[:, 1] = 0
    nothing = np.zeros((3000, 2))
    x = terms(nothing + 1, nothing, nothing, nothing == 1, 0.01)
    found = Allowance.fit(left, x, 50, (0,))
    assert found.weights[0, 0] > 1
    assert found.weights[1].tolist() == [1e-9, 0, 0, 0, 0, 0]
    other = Allowance(np.full((2, TERMS), 7.0))
    both = found.where(np.array([True, False]), other)
    assert both.weights.tolist() == [found.weights[0].tolist(), [7] * TERMS]
    assert len(peaks(np.zeros(100), 50)) == len(peaks(np.zeros(0), 50)) == 0
    assert peaks(np.array([0, 3, 3, 0, 0, 0, 1.0]), 3).tolist() == [1, 6]


def test_friction_is_a_floor_that_joints_share():
    bound = Allowance(np.array([[2.0, 1], [0.1, 1], [3.0, 1]]))
    level = np.array([10.0, 10.0, 10.0])
    assert bound.at_least(level).weights[:, 0] == pytest.approx([2, 2, 3])
    tight = Allowance(np.array([[0.5, 1], [0.1, 1], [3.0, 1]]))
    assert tight.at_least(level).weights[:, 0] == pytest.approx([1, 1, 3])  # a tenth
    np.testing.assert_array_equal(bound.at_least(level).weights[:, 1], 1)


def test_a_tail_is_followed_past_the_largest_peak():
    rng = np.random.default_rng(3)
    drawn = np.sort(rng.exponential(size=4000))[::-1]
    # One in 400,000: log(400,000) for the exponential distribution.
    assert followed(drawn, 0.01, 80) == pytest.approx(np.log(4e5), rel=0.15)
    assert followed(np.array([2.0]), 0.5, 10) > 2.0
