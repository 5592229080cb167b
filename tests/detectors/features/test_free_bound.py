"""Quantile regression with a prior."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.detectors.features.free_bound import Bound, upper_quantile


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 1000), st.sampled_from([0.5, 0.9, 0.99]))
def test_without_a_prior_the_share_of_rows_below_is_the_quantile(seed, quantile):
    rng = np.random.default_rng(seed)
    x = np.column_stack([np.ones(600), rng.uniform(0, 2, 600)])
    y = (1 + 3 * x[:, 1]) * np.abs(rng.normal(size=600))
    c = upper_quantile(x, y, quantile, np.zeros(2), np.zeros(2))
    # A vertex of the linear programme passes through two rows.
    assert np.mean(y <= x @ c + 1e-9) == pytest.approx(quantile, abs=3 / 600)


def test_known_coefficients_are_found():
    rng = np.random.default_rng(1)
    x = np.column_stack([np.ones(4000), rng.uniform(0, 2, 4000), rng.uniform(0, 5, 4000)])
    y = x @ [0.5, 0.2, 0.3] * rng.uniform(0, 1, 4000)
    c = upper_quantile(x, y, 0.99, np.zeros(3), np.ones(3))
    assert c == pytest.approx([0.5, 0.2, 0.3], abs=0.06)


def test_what_no_row_shows_keeps_the_prior():
    prior = np.array([0.3, 0.02, 0.05])
    weight = np.array([500.0, 250.0, 1000.0])
    nothing = upper_quantile(np.empty((0, 3)), np.empty(0), 0.99, prior, weight)
    assert nothing == pytest.approx(prior)
    x = np.column_stack([np.ones(800), np.zeros(800), np.zeros(800)])
    still = upper_quantile(x, np.full(800, 0.1), 0.99, prior, weight)
    assert still == pytest.approx([0.1, 0.02, 0.05])
    few = upper_quantile(x[:20], np.full(20, 0.1), 0.99, prior, weight)
    assert few == pytest.approx(prior)
    larger = upper_quantile(x[:50], np.full(50, 0.9), 0.99, prior, weight)
    assert larger == pytest.approx([0.9, 0.02, 0.05])


def test_thinned_rows_count_as_all():
    x = np.column_stack([np.ones(900), np.zeros(900)])
    y = np.full(900, 0.1)
    prior, weight = np.array([0.3, 0.0]), np.array([600.0, 1.0])
    for rows in (900, 90):
        assert upper_quantile(x, y, 0.99, prior, weight, rows)[0] == pytest.approx(0.1)


@pytest.mark.parametrize("field", ["fast", "hard"])
@pytest.mark.parametrize("bad", [0.0, -1.0, np.inf, np.nan])
def test_a_bound_that_never_alarms_is_refused(field, bad):
    """At 0 the bound of a joint that stands is 0/0, which no residual exceeds."""
    bound = Bound.prior(*np.ones((4, 2)))
    with pytest.raises(ValueError, match=f"{field} .*expected finite numbers above 0"):
        replace(bound, **{field: np.array([1.0, bad])})
