"""Moving convex bodies against exact rational times of impact: no miss, nothing late."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from oracles.convex_bodies import HARD, KINDS
from oracles.convex_impact import exact_toi
from oracles.convex_overlap import cross, dot, exact_vertices, float_bodies
from tauguard.rigid import Boxes, Hulls, Tetrahedra, overlap, sweep
from tauguard.rigid.queries import native_sweep

PAIRS = [(a, b) for a in KINDS for b in KINDS]


def moved(bodies, d):
    if isinstance(bodies, Tetrahedra):
        return Tetrahedra(bodies.vertices + d[:, None])
    if isinstance(bodies, Boxes):
        return Boxes(bodies.center + d, bodies.half_extents, bodies.rotation)
    return type(bodies)(bodies.origin + d, bodies.edges)


def check(a, b, d, tolerance, methods=("abfme", "sat", "auto")):
    """Hits exact, toi within ``tolerance`` before the truth; returns the truth as floats."""
    truth = [exact_toi(a, b, d, i) for i in range(len(d))]
    expected = np.array([t is not None for t in truth])
    for method in methods:
        got = sweep(a, b, d, method=method)
        np.testing.assert_array_equal(got.hit, expected, err_msg=method)
        assert np.isinf(got.time_of_impact[~expected]).all()
        assert np.isnan(got.point[~expected]).all()
        assert np.isnan(got.normal[~expected]).all()
        for i in np.flatnonzero(expected):
            assert got.time_of_impact[i] <= truth[i] or truth[i] == 0, (
                f"{method} is late in row {i}"
            )
            assert truth[i] - got.time_of_impact[i] <= tolerance, f"{method} is early in row {i}"
    return np.array([np.inf if t is None else float(t) for t in truth])


@pytest.mark.parametrize(("kind_a", "kind_b"), PAIRS)
def test_random_bodies(kind_a, kind_b):
    rng = np.random.default_rng(31)
    n = 60
    d = rng.uniform(-4, 4, (n, 3))
    a, b = KINDS[kind_a](rng, n), moved(KINDS[kind_b](rng, n), -0.5 * d)
    truth = check(a, b, d, 1e-9)
    assert 5 < np.isfinite(truth).sum() < n - 5
    assert (truth[np.isfinite(truth)] > 0).sum() > 10


numbers = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False, width=64),
    st.integers(-3, 3).map(float),
    st.sampled_from([5e-324, 1e-170, 1e-300, 1e300, 1.7976931348623157e308]),
)


@settings(max_examples=60, deadline=None)
@given(st.lists(numbers, min_size=27, max_size=27))
def test_any_finite_tetrahedra(values):
    v = np.array(values)
    a, b, d = (
        Tetrahedra(v[None, :12].reshape(1, 4, 3)),
        Tetrahedra(v[None, 12:24].reshape(1, 4, 3)),
        v[None, 24:],
    )
    for body in (a, b):
        e = exact_vertices(body, 0)[1]
        assume(dot(e[0], cross(e[1], e[2])) != 0)
    expected = exact_toi(a, b, d, 0)
    for method in ("abfme", "sat"):
        got = sweep(a, b, d, method=method)
        assert got.hit[0] == (expected is not None), method
        assert expected is None or got.time_of_impact[0] <= expected or expected == 0


def test_grid_motions_touch_at_once_or_slide_past():
    rng = np.random.default_rng(5)
    a, b = HARD["grid"](rng, 250)
    volume = [np.abs(np.linalg.det(t.vertices[:, 1:] - t.vertices[:, :1])) > 0.5 for t in (a, b)]
    keep = volume[0] & volume[1]
    a, b = Tetrahedra(a.vertices[keep]), Tetrahedra(b.vertices[keep])
    d = rng.integers(-2, 3, (len(a), 3)).astype(float)
    truth = check(a, Tetrahedra(b.vertices - d[:, None]), d, 1e-9)
    assert (np.isfinite(truth) & (truth > 0)).sum() > 10


def test_boxes_dropped_on_boxes():
    n = 150
    rng = np.random.default_rng(6)
    eye = np.tile(np.eye(3), (n, 1, 1))
    half_a, half_b = rng.integers(1, 4, (2, n, 3)) / 4
    height = half_a[:, 2] + half_b[:, 2] + rng.integers(0, 5, n) / 8
    start = np.c_[rng.integers(-4, 5, (n, 2)) / 4, height]
    d = np.tile([0.0, 0.0, -0.5], (n, 1))
    truth = check(Boxes(np.zeros((n, 3)), half_a, eye), Boxes(start, half_b, eye), d, 1e-12)
    landed = np.isfinite(truth)
    assert 50 < landed.sum() < n
    result = sweep(Boxes(np.zeros((n, 3)), half_a, eye), Boxes(start, half_b, eye), d)
    on_top = landed & (np.abs(start[:, :2]) < (half_a + half_b)[:, :2]).all(axis=1)
    np.testing.assert_allclose(
        result.normal[on_top], np.tile([0, 0, 1.0], (on_top.sum(), 1)), atol=1e-12
    )
    np.testing.assert_allclose(result.point[on_top, 2], half_a[on_top, 2], atol=1e-9)


@pytest.mark.parametrize(
    ("kind_a", "kind_b"), [("boxes", "tetrahedra"), ("parallelepipeds", "boxes")]
)
def test_point_is_common_and_normal_separates(kind_a, kind_b):
    rng = np.random.default_rng(41)
    n = 200
    d = rng.uniform(-4, 4, (n, 3))
    a, b = KINDS[kind_a](rng, n), moved(KINDS[kind_b](rng, n), -0.5 * d)
    result = sweep(a, b, d)
    hit = result.hit & (result.time_of_impact > 0)
    (va, _), (vb, _) = float_bodies(a, n), float_bodies(b, n)
    vb = vb + (np.where(result.hit, result.time_of_impact, 0)[:, None] * d)[:, None]
    va, vb, normal, point = va[hit], vb[hit], result.normal[hit], result.point[hit]
    assert len(va) > 30
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1, rtol=1e-12)
    top = np.einsum("nvk,nk->nv", va, normal).max(axis=1)
    bottom = np.einsum("nvk,nk->nv", vb, normal).min(axis=1)
    np.testing.assert_allclose(top, bottom, atol=1e-8)
    assert (np.einsum("nk,nk->n", d[hit], normal) < 0).all()
    eye = np.tile(np.eye(3), (len(va), 1, 1))
    near = Boxes(point, np.full(point.shape, 1e-8), eye)
    for vertices in (va, vb):
        count = vertices.shape[1]
        body = Hulls(vertices.reshape(-1, 3), count * np.arange(len(va) + 1))
        assert overlap(body, near).hit.all()


def test_hulls_by_exact_advancement():
    rng = np.random.default_rng(8)
    n = 25
    a, b = KINDS["tetrahedra"](rng, n), KINDS["tetrahedra"](rng, n)
    d = rng.uniform(-4, 4, (n, 3))
    b = Tetrahedra(b.vertices - 0.5 * d[:, None])
    hulls = [Hulls(t.vertices.reshape(-1, 3), 4 * np.arange(n + 1)) for t in (a, b)]
    want, got = sweep(a, b, d), sweep(*hulls, d)
    np.testing.assert_array_equal(got.hit, want.hit)
    np.testing.assert_allclose(got.time_of_impact, want.time_of_impact, rtol=1e-9)


def test_overlap_from_the_start_has_no_normal():
    rng = np.random.default_rng(10)
    a = KINDS["boxes"](rng, 50)
    result = sweep(a, a, np.ones((50, 3)))
    assert result.hit.all()
    assert (result.time_of_impact == 0).all()
    assert np.isnan(result.normal).all()
    assert np.isfinite(result.point).all()


def test_no_motion_is_overlap():
    rng = np.random.default_rng(13)
    a, b = HARD["grid"](rng, 300)
    for method in ("abfme", "sat", "auto"):
        np.testing.assert_array_equal(
            sweep(a, b, [0.0, 0, 0], method=method).hit, overlap(a, b).hit
        )


@pytest.mark.parametrize("method", ["abfme", "sat", "auto"])
def test_threads_change_nothing(method):
    rng = np.random.default_rng(14)
    a, b = KINDS["boxes"](rng, 3000), KINDS["tetrahedra"](rng, 3000)
    d = rng.uniform(-3, 3, (3000, 3))
    one = native_sweep(a, b, d, method)
    for threads in (2, 5):
        for x, y in zip(native_sweep(a, b, d, method, threads), one, strict=True):
            np.testing.assert_array_equal(x, y)


def test_bad_arguments():
    a = Tetrahedra(np.zeros((3, 4, 3)))
    with pytest.raises(ValueError, match="displacement: 2 rows, expected 3 or 1"):
        sweep(a, a, np.zeros((2, 3)))
    with pytest.raises(ValueError, match="displacement: nan in row 1"):
        sweep(a, a, [[0, 0, 0], [0, np.nan, 0], [0, 0, 0]])
    with pytest.raises(ValueError, match="method: 'gjk', expected one of abfme, sat, auto"):
        sweep(a, a, [1.0, 0, 0], method="gjk")
