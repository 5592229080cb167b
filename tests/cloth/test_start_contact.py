"""Features that touch at the start of a step: a test of its own decides them, exactly."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.cloth import Groups, MeshCCD, edge_edge, vertex_face

QUERIES = {"vf": vertex_face, "ee": edge_edge}


def at_rest(rng, n, kind):
    """Queries on a small lattice, so that most are degenerate: flat, on a line, in a point."""
    x = rng.integers(-2, 3, size=(n, 2, 4, 3)).astype(float)
    if kind == "flat":
        x[np.arange(n), 0, :, rng.integers(3, size=n)] = rng.integers(-1, 2, size=(n, 1))
    elif kind == "line":
        x[:, 0, :, 1:] = x[:, 0, :1, 1:]
    elif kind == "thirds":  # differences round
        x /= 3
        x[:, 0, :, 0] = 1 / 7
    elif kind == "tilted":
        a, b = np.array([1.0, 2, -1]), np.array([0.0, 1, 3])
        x[:, 0] = x[:, 0, :, :1] * a + x[:, 0, :, 1:2] * b
    elif kind == "tiny":
        x *= 2.0**-1060
        x[:, 0, :, 2] = 0
    elif kind == "wide":
        x[:, 0, :, 0] = 5
        x[:, 0, :, 1] *= 2.0 ** rng.integers(-90, 90, size=(n, 4))
    return x


@pytest.mark.parametrize("kind", ["lattice", "flat", "line", "thirds", "tilted", "tiny", "wide"])
@pytest.mark.parametrize("query", QUERIES)
def test_hits_and_times_are_those_of_exact_arithmetic(query, kind):
    x = at_rest(np.random.default_rng(7), 1_500, kind)
    ours = QUERIES[query](x[:, 0], x[:, 1])
    exact = QUERIES[query](x[:, 0], x[:, 1], method="exact")
    assert np.array_equal(ours.hit, exact.hit)
    assert np.all(ours.toi[exact.toi == 0] == 0)
    assert np.all(exact.toi[ours.toi == 0] <= 1e-9)
    assert (exact.toi == 0).sum() > 30
    assert np.all(ours.toi[ours.hit] <= exact.toi[ours.hit])


@settings(deadline=None, max_examples=200)
@given(st.lists(st.integers(-2, 2), min_size=24, max_size=24), st.integers(-300, 300))
def test_any_lattice_query_at_any_scale(numbers, exponent):
    x = np.ldexp(np.array(numbers, dtype=float).reshape(2, 1, 4, 3), exponent)
    for query in QUERIES.values():
        ours, exact = query(*x), query(*x, method="exact")
        assert ours.hit == exact.hit
        assert ours.toi == 0 or exact.toi > 0
        assert exact.toi <= 1e-9 or ours.toi > 0


def test_bodies_at_rest_on_one_another_are_decided_at_the_start():
    # Two boxes' grids, face on face: every candidate touches, none goes on to intervals of time.
    g = np.arange(7) / 6
    p = np.stack(np.meshgrid(g, g, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    a = (np.arange(6)[:, None] * 7 + np.arange(6)).ravel()
    sheet = np.concatenate([np.c_[a, a + 1, a + 7], np.c_[a + 1, a + 8, a + 7]])
    faces = np.concatenate([sheet, sheet + len(p)])
    groups = Groups(np.repeat([0, 1], len(p)), [[False, True], [True, False]])
    x_t0 = np.concatenate([p, p])
    x_t1 = x_t0 + np.repeat([[0, 0, 0], [0.02, 0.01, 0.03]], len(p), axis=0)
    frame = MeshCCD(faces, groups=groups).find(x_t0, x_t1)
    exact = MeshCCD(faces, method="exact", groups=groups).find(x_t0, x_t1)
    assert np.array_equal(frame.vf, exact.vf)
    assert np.array_equal(frame.ee, exact.ee)
    for stats, toi in (
        (frame.stats.vf, frame.vf_impacts.toi),
        (frame.stats.ee, frame.ee_impacts.toi),
    ):
        assert stats["at_start"] == stats["hits"] == (toi == 0).sum() > 100
        assert stats["exact"] == 0


def sliding(rng, n, kind):
    """Queries whose vertices stay in a plane across an axis, which may move itself."""
    x = rng.normal(size=(n, 2, 4, 3))
    if kind == "lattice":  # vertices that meet vertices, edges that lie on edges
        x = rng.integers(-3, 4, size=x.shape).astype(float)
    elif kind == "thirds":
        x = rng.integers(-3, 4, size=x.shape) / 3 + np.array([1e3, 0.1, 0.7])
    elif kind == "rigid":  # two pieces, each without a turn
        x[:, 1] = x[:, 0] + np.repeat(rng.normal(size=(n, 2, 3)), 2, axis=1)
    elif kind == "slow":
        x[:, 1] = x[:, 0] + 1e-6 * rng.normal(size=(n, 4, 3))
    elif kind == "far":
        x += 1e6
    elif kind == "tiny":
        x *= 1e-200
    x[np.arange(n), :, :, rng.integers(3, size=n)] = rng.normal(size=(n, 2, 1))
    return x


@pytest.mark.parametrize("kind", ["any", "lattice", "thirds", "rigid", "slow", "far", "tiny"])
@pytest.mark.parametrize("query", QUERIES)
def test_what_slides_on_a_plane_has_the_hits_and_times_of_exact_arithmetic(query, kind):
    x = sliding(np.random.default_rng(11), 600, kind)
    ours = QUERIES[query](x[:, 0], x[:, 1])
    exact = QUERIES[query](x[:, 0], x[:, 1], method="exact")
    assert np.array_equal(ours.hit, exact.hit)
    assert exact.hit.sum() > 20
    assert np.all(ours.toi[ours.hit] <= exact.toi[ours.hit])
    assert np.all(ours.toi[ours.hit] >= exact.toi[ours.hit] - 1e-9)
