"""ab2pf and exact beside exact integers that share no code with them."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from oracles.adversarial_queries import KINDS
from oracles.mesh_contact import first_contact, judge
from tauguard.cloth import edge_edge, vertex_face
from tests.cloth.solve import solve_each

QUERIES = {"vf": vertex_face, "ee": edge_edge}

lattice = hnp.arrays(np.float64, (2, 4, 3), elements=st.integers(-2, 2).map(float))
flat = hnp.arrays(np.float64, (2, 4, 3), elements=st.integers(-3, 3).map(float)).map(
    lambda x: x * np.array([1, 1, 0])
)
line = hnp.arrays(np.float64, (2, 4, 1), elements=st.integers(-3, 3).map(float)).map(
    lambda x: x * np.array([1, 2, -1])
)
apart = hnp.arrays(
    np.float64,
    (2, 4, 3),
    elements=st.tuples(st.integers(-3, 3), st.integers(-70, 5)).map(lambda m: m[0] * 2.0 ** m[1]),
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
@pytest.mark.parametrize("positions", [lattice, flat, line, thirds, apart])
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
def test_integers_of_fixed_width_decide_most_and_as_those_of_any_width(kind):
    """Made to touch in a corner or on an edge, flat, on a lattice: with exponents far apart too."""
    rng = np.random.default_rng(5)
    x = rng.normal(size=(3_000, 2, 4, 3))
    x[:1000, 1, 0] = 2 * (x[:1000, :, 1] + x[:1000, :, 2]).sum(axis=1) / 4 - x[:1000, 0, 0]
    x[1000:2000, :, :, 2] = 0
    x[2000:] = rng.integers(-2, 3, size=(1000, 2, 4, 3)) / 3
    x[::10] *= 10.0 ** rng.integers(-9, 9, size=(300, 1, 1, 3))  # an axis each
    x[5::10] *= 10.0 ** rng.integers(-40, 1, size=(300, 2, 4, 3))  # a coordinate each
    ours, exact = (solve_each(kind == "vf", x, method) for method in ("ab2pf", "exact"))
    assert np.array_equal(ours.hit, exact.hit)
    early = exact.toi[exact.hit] - ours.toi[exact.hit]
    assert early.min() >= 0
    assert early.max() <= 1e-9
    assert ours.counts["exact"] > 500
    assert 0 < ours.counts["long_exact"] < 0.5 * ours.counts["exact"]


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


@pytest.mark.parametrize("kind", QUERIES)
@pytest.mark.parametrize("name", KINDS)
def test_adversarial_queries(name, kind):
    x = KINDS[name](np.random.default_rng(3), 100, kind == "vf")
    found = judge(x, kind == "vf", QUERIES[kind](x[:, 0], x[:, 1]).toi)
    assert (found.misses, found.false_hits, found.late) == (0, 0, 0)
    assert found.early_most <= 1e-9


def test_integers_find_the_closed_form():
    face = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    start, end = np.array([[0.25, 0.25, 1], *face]), np.array([[0.25, 0.25, 0], *face])
    assert first_contact(start, end, True) == (1, 1)
    end[0, 2] = -3
    assert first_contact(start, end, True) == (Fraction(1, 4), Fraction(1, 4))
    # At x = t the face has the height t^2, the vertex 1 - 2 t: sqrt(2) - 1.
    start[0], end[0], end[2] = (0, 0.25, 1), (1, 0.25, -1), (1, 0, 1)
    low, high = first_contact(start, end, True)
    assert (low + 1) ** 2 < 2 < (high + 1) ** 2
    assert high - low == Fraction(1, 2**64)
    edges = np.array([[0.0, 0, 1], [1, 0, 1], [0.25, -1, 0], [0.25, 1, 0]])
    moved = edges.copy()
    moved[2:, 2] = 3.0
    low, high = first_contact(edges, moved, False)
    assert low < Fraction(1, 3) < high
    moved[2:, 0] = 2.0  # 0.25 + 1.75 t is still within the other edge at t = 1/3
    assert first_contact(edges, moved, False) == (low, high)
    moved[2:, 0] = 3.0  # 0.25 + 2.75 t is not
    assert first_contact(edges, moved, False) is None


def test_integers_count_every_wrong_answer():
    x = np.random.default_rng(0).normal(size=(900, 2, 4, 3))
    times = [first_contact(*each, False) for each in x]
    toi = np.array([np.inf if time is None else float(time[0]) - 1e-12 for time in times])
    found = judge(x, False, toi)
    hits = np.flatnonzero(np.isfinite(toi))
    assert np.array_equal(np.flatnonzero(found.hit), hits)
    assert len(hits) > 100
    assert (found.misses, found.false_hits, found.late) == (0, 0, 0)
    assert 0.9e-12 < found.early_most < 1.1e-12
    toi[hits[:3]] = np.inf
    toi[hits[3:8]] += 2e-12
    toi[np.flatnonzero(np.isinf(toi))[-2:]] = 0.5
    found = judge(x, False, toi)
    assert (found.misses, found.false_hits, found.late) == (3, 2, 5)


def test_integers_order_a_time_between_the_bounds_exactly():
    """No double equals the root 1/3: its lower neighbour is early, its upper neighbour late."""
    start = np.array([[0.25, 0.25, 1], [0, 0, 0], [1, 0, 0], [0, 1, 0]])
    end = start.copy()
    end[0, 2] = -2.0
    third = 1 / 3  # rounded down
    x, toi = np.stack([[start, end]] * 2), np.array([third, np.nextafter(third, 1)])
    assert judge(x, True, toi).late == 1
