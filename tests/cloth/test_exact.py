"""ab2pf and exact against integer arithmetic of another make, on random and adversarial queries."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from tauguard.cloth import edge_edge, vertex_face
from tests.cloth.rational import first_contact

QUERIES = {"vf": vertex_face, "ee": edge_edge}

lattice = hnp.arrays(np.float64, (2, 4, 3), elements=st.integers(-2, 2).map(float))
flat = hnp.arrays(np.float64, (2, 4, 3), elements=st.integers(-3, 3).map(float)).map(
    lambda x: x * np.array([1, 1, 0])
)
line = hnp.arrays(np.float64, (2, 4, 1), elements=st.integers(-3, 3).map(float)).map(
    lambda x: x * np.array([1, 2, -1])
)
thirds = lattice.map(lambda x: x / 3)  # rounded: nearly degenerate, not quite


def assert_right(kind, x):
    truth = first_contact(x[0], x[1], kind == "vf")
    for method in ("exact", "ab2pf"):
        toi = float(QUERIES[kind](x[0][None], x[1][None], method=method).toi[0])
        if truth is None:
            assert toi == np.inf, method
        else:
            low, high = truth
            assert toi <= high, method
            assert toi >= low - (2**-50 if method == "exact" else 1e-9), method


@pytest.mark.parametrize("kind", QUERIES)
@pytest.mark.parametrize("positions", [lattice, flat, line, thirds])
def test_any_query_is_answered_as_integers_do(kind, positions):
    @settings(deadline=None, max_examples=60)
    @given(positions)
    def check(x):
        assert_right(kind, x)

    check()


@pytest.mark.parametrize("kind", QUERIES)
@pytest.mark.parametrize("offset", [0.0, 1e6, 1e10])
def test_random_queries(kind, offset):
    rng = np.random.default_rng(0)
    for x in rng.normal(size=(40, 2, 4, 3)) + offset:
        assert_right(kind, x)


@pytest.mark.parametrize("kind", QUERIES)
def test_a_root_at_which_a_weight_is_zero(kind):
    """Contact at the corner, at a time that no double is: sqrt(2) - 1 and its like."""
    for a in (2.0, 3.0, 5.0, 7.0):
        x = np.array(
            [
                [[0, 0, 1], [0, 0, 0], [1, 0, 0], [0, 1, 0]],
                [[0, 0, -a], [0, 0, 0], [1, 0, 0], [0, 1, 0]],
            ],
            dtype=float,
        )
        assert_right(kind, x)
        x[1, 2] = [0, a, 1]
        assert_right(kind, x)


@pytest.mark.parametrize("kind", QUERIES)
@pytest.mark.parametrize("exponent", [-1000, -300, 300, 1000])
def test_scaling_changes_nothing(kind, exponent):
    """Also where a product, or even a difference, leaves the range of doubles."""
    rng = np.random.default_rng(1)
    x = np.concatenate([rng.integers(-2, 3, size=(300, 2, 4, 3)), rng.normal(size=(300, 2, 4, 3))])
    here = QUERIES[kind](x[:, 0], x[:, 1])
    there = QUERIES[kind](np.ldexp(x[:, 0], exponent), np.ldexp(x[:, 1], exponent))
    assert here.hit.sum() > 50
    assert np.array_equal(here.hit, there.hit)
    assert np.abs(here.toi[here.hit] - there.toi[here.hit]).max() <= 1e-9
    largest = np.full((1, 2, 4, 3), np.finfo(float).max)
    largest[0, 0, 0] *= -1
    assert QUERIES[kind](largest[:, 0], largest[:, 1]).hit[0]
