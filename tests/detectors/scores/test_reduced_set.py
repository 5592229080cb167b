"""Reduced support vectors: exact where nothing is lost, the best of their span otherwise."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.detectors.scores.kernel import SrqRegressor, reduced_set, srq_kernel


def squared_error(vectors, alpha, chosen, beta, sigma):
    """|f - g|^2 in the kernel's Hilbert space, from its definition."""
    both, weights = np.concatenate([vectors, chosen]), np.concatenate([alpha, -beta])
    return float(weights @ srq_kernel(both, both, sigma) @ weights)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**31), size=st.integers(1, 40), d=st.integers(1, 12))
def test_all_vectors_give_the_same_function_and_fewer_the_best_of_their_span(seed, size, d):
    rng = np.random.default_rng(seed)
    vectors, alpha = rng.normal(size=(size, d)), rng.normal(size=size)
    points = rng.normal(size=(20, d))
    truth = srq_kernel(points, vectors, 1.5) @ alpha
    same, beta = reduced_set(vectors, alpha, 1.5, size)
    np.testing.assert_allclose(srq_kernel(points, same, 1.5) @ beta, truth, atol=1e-4)
    errors = []
    for count in range(1, size + 1):
        chosen, beta = reduced_set(vectors, alpha, 1.5, count)
        assert len(chosen) <= count
        errors.append(squared_error(vectors, alpha, chosen, beta, 1.5))
        nudged = beta + 1e-3 * rng.normal(size=len(beta))
        assert squared_error(vectors, alpha, chosen, nudged, 1.5) > errors[-1] - 1e-9
    assert all(b <= a + 1e-8 for a, b in itertools.pairwise(errors))


def test_vectors_on_a_line_that_nearly_depend_on_each_other_are_no_error():
    rng = np.random.default_rng(60502)
    vectors, alpha = rng.normal(size=(36, 1)), rng.normal(size=36)
    points = np.linspace(-3, 3, 50)[:, None]
    few, beta = reduced_set(vectors, alpha, 1.5, 36)
    truth = srq_kernel(points, vectors, 1.5) @ alpha
    np.testing.assert_allclose(srq_kernel(points, few, 1.5) @ beta, truth, atol=1e-4)


def test_vectors_that_are_there_twice_are_kept_once():
    rng = np.random.default_rng(0)
    vectors = rng.normal(size=(10, 3))
    twice, alpha = np.concatenate([vectors, vectors]), rng.normal(size=20)
    chosen, beta = reduced_set(twice, alpha, 3.0, 20)
    assert len(chosen) == 10
    points = rng.normal(size=(30, 3))
    truth = srq_kernel(points, twice, 3.0) @ alpha
    np.testing.assert_allclose(srq_kernel(points, chosen, 3.0) @ beta, truth, atol=1e-6)


def test_a_smooth_function_needs_few_vectors():
    rng = np.random.default_rng(1)
    x = rng.uniform(-2, 2, size=(400, 2))
    model = SrqRegressor(epsilon=0.001, C=10).fit(x, np.sin(x[:, 0]) * x[:, 1])
    small = model.machine_.reduced(40)
    assert len(small.vectors) == 40 < len(model.machine_.vectors) / 3
    fresh = rng.uniform(-2, 2, size=(200, 2))
    assert np.abs(small(fresh) - model.predict(fresh)).max() < 0.02


@pytest.mark.parametrize("count", [0, 6])
def test_an_impossible_count_is_refused(count):
    with pytest.raises(ValueError, match="expected 1 to the 5"):
        reduced_set(np.eye(5), np.ones(5), 3.0, count)
