"""Overlap of convex bodies against exact arithmetic: no wrong answer of either kind."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from oracles.convex_bodies import HARD, KINDS
from oracles.convex_overlap import exact_hit, float_bodies, truth
from tauguard.geometry import _geometry
from tauguard.rigid import Boxes, Hulls, Parallelepipeds, Polygons, Tetrahedra, _rigid, overlap
from tauguard.rigid.comparators import overlap_by
from tauguard.rigid.queries import native_overlap, native_sweep, portable

EXACT_METHODS = ["abfme", "auto", "exact"]
PAIRS = [(a, b) for a in KINDS for b in KINDS]


def check(a, b, expected):
    hulls = isinstance(a, Hulls) or isinstance(b, Hulls)
    for method in EXACT_METHODS if hulls else [*EXACT_METHODS, "sat"]:
        got, _ = native_overlap(a, b, method)
        false_hit, false_clear = int((got & ~expected).sum()), int((~got & expected).sum())
        assert (false_hit, false_clear) == (0, 0), method


@pytest.mark.parametrize(("kind_a", "kind_b"), PAIRS)
def test_random_bodies(kind_a, kind_b):
    rng = np.random.default_rng(11)
    a, b = KINDS[kind_a](rng, 4000), KINDS[kind_b](rng, 4000)
    expected = truth(a, b, sample=(100, 0))
    assert 0.1 < expected.mean() < 0.9
    check(a, b, expected)


@pytest.mark.parametrize(("kind_a", "kind_b"), PAIRS)
def test_textbook_axes_are_right_where_rounding_cannot_matter(kind_a, kind_b):
    rng = np.random.default_rng(12)
    a, b = KINDS[kind_a](rng, 1000), KINDS[kind_b](rng, 1000)
    np.testing.assert_array_equal(overlap_by(a, b, "sat_textbook")[0], truth(a, b))


@pytest.mark.parametrize("name", HARD)
def test_hard_cases(name):
    a, b = HARD[name](np.random.default_rng(7), 800)
    expected = truth(a, b, sample=(100, 0))
    assert 0.02 < expected.mean() < 0.98
    check(a, b, expected)
    check(b, a, expected)


numbers = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False, width=64),
    st.integers(-2, 2).map(float),
    st.sampled_from([5e-324, -1e-300, 1e300, 1.7976931348623157e308]),
)


@settings(max_examples=150, deadline=None)
@given(st.lists(numbers, min_size=24, max_size=24))
def test_any_finite_tetrahedra(values):
    v = np.array(values).reshape(2, 1, 4, 3)
    a, b = Tetrahedra(v[0]), Tetrahedra(v[1])
    check(a, b, np.array([exact_hit(a, b, 0)]))


@settings(max_examples=80, deadline=None)
@given(st.lists(numbers, min_size=18, max_size=18))
def test_any_finite_boxes_and_parallelepipeds(values):
    v = np.array(values)
    a = Boxes(v[None, :3], np.abs(v[None, 3:6]), np.eye(3)[None])
    b = Parallelepipeds(v[None, 6:9], v[9:].reshape(1, 3, 3))
    check(a, b, np.array([exact_hit(a, b, 0)]))


def test_hulls_of_any_size_agree_with_the_truth():
    rng = np.random.default_rng(4)
    counts = rng.integers(1, 9, 300)
    offsets = np.r_[0, np.cumsum(counts)]
    a = Hulls(rng.integers(-3, 4, (offsets[-1], 3)), offsets)
    b = Hulls(rng.integers(-2, 5, (offsets[-1], 3)), offsets)
    expected = np.array([exact_hit(a, b, i) for i in range(len(a))])
    assert 0.05 < expected.mean() < 0.95
    check(a, b, expected)


def random_hulls(rng, n, low, high, dimension):
    counts = rng.integers(low, high, n)
    offsets = np.r_[0, np.cumsum(counts)]
    shift = np.repeat(rng.uniform(-1, 1, (n, dimension)), counts, axis=0)
    return rng.uniform(-0.8, 0.8, (offsets[-1], dimension)) + shift, offsets


def test_elimination_decides_random_hulls_without_exact_arithmetic():
    rng = np.random.default_rng(15)
    a, b = (Hulls(*random_hulls(rng, 400, 4, 9, 3)) for _ in range(2))
    expected, _ = native_overlap(a, b, "exact")
    assert 0.1 < expected.mean() < 0.9
    for method in ("abfme", "auto"):
        hit, left = native_overlap(a, b, method)
        np.testing.assert_array_equal(hit, expected)
        assert left == 0, method


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("offset", [0.0, 1e6])
def test_hulls_meet_every_other_kind(kind, offset):
    rng = np.random.default_rng(17)
    vertices, offsets = random_hulls(rng, 300, 4, 7, 3)
    shift = np.array([offset, 0.0, -offset])
    hulls, others = Hulls(vertices + shift, offsets), KINDS[kind](rng, 300)
    if kind == "tetrahedra":
        others = Tetrahedra(others.vertices + shift)
    elif kind == "boxes":
        others = Boxes(others.center + shift, others.half_extents, others.rotation)
    else:
        others = Parallelepipeds(others.origin + shift, others.edges)
    expected, _ = native_overlap(hulls, others, "exact")
    assert 0.1 < expected.mean() < 0.9
    hit, left = native_overlap(hulls, others, "auto")
    np.testing.assert_array_equal(hit, expected)
    assert left < 3 or offset  # corners computed far from the origin are rounded
    np.testing.assert_array_equal(native_overlap(others, hulls, "abfme")[0], expected)


def polygon_truth(a, b, i):
    pa, pb = (Hulls(np.c_[p.vertices, np.zeros(len(p.vertices))], p.offsets) for p in (a, b))
    return exact_hit(pa, pb, i)


def test_polygons_in_the_plane():
    rng = np.random.default_rng(16)
    a, b = (Polygons(*random_hulls(rng, 300, 3, 9, 2)) for _ in range(2))
    expected = np.array([polygon_truth(a, b, i) for i in range(300)])
    assert 0.1 < expected.mean() < 0.9
    for method in ("abfme", "auto"):
        hit, left = native_overlap(a, b, method)
        np.testing.assert_array_equal(hit, expected)
        assert left == 0
    grid_a, grid_b = (
        Polygons(rng.integers(0, 4, p.vertices.shape).astype(float), p.offsets) for p in (a, b)
    )
    expected = np.array([polygon_truth(grid_a, grid_b, i) for i in range(300)])
    assert 0.1 < expected.mean() < 0.99
    np.testing.assert_array_equal(overlap(grid_a, grid_b, "abfme").hit, expected)
    with pytest.raises(ValueError, match="polygons are tested against polygons only"):
        overlap(a, Hulls(np.zeros((300, 3)), np.arange(301)))


@pytest.mark.parametrize("scale", [2.0**-900, 2.0**-300, 2.0**300, 2.0**900])
def test_power_of_two_scaling_changes_nothing(scale):
    a, b = HARD["grid"](np.random.default_rng(3), 500)
    expected, _ = native_overlap(a, b, "exact")
    check(Tetrahedra(a.vertices * scale), Tetrahedra(b.vertices * scale), expected)


def test_one_body_meets_every_other():
    rng = np.random.default_rng(2)
    one, many = KINDS["boxes"](rng, 1), KINDS["tetrahedra"](rng, 500)
    tiled = Boxes(
        *(np.repeat(x, 500, axis=0) for x in (one.center, one.half_extents, one.rotation))
    )
    for method in ("abfme", "auto"):
        np.testing.assert_array_equal(
            overlap(one, many, method).hit, overlap(tiled, many, method).hit
        )
        np.testing.assert_array_equal(
            overlap(many, one, method).hit, overlap(many, tiled, method).hit
        )


@pytest.mark.parametrize("name", ["grid", "slivers", "touching boxes"])
def test_witness_shows_why(name):
    a, b = HARD[name](np.random.default_rng(5), 200)
    result = overlap(a, b)
    w = result.witness
    assert np.isnan(w.point[~result.hit]).all()
    assert np.isnan(w.normal[result.hit]).all()
    (va, _), (vb, _) = float_bodies(a, len(a)), float_bodies(b, len(b))
    tolerance = 1e-14 * np.abs(np.concatenate([va, vb], axis=1)).max()
    clear = ~result.hit
    below = np.einsum("nvk,nk->nv", va[clear], w.normal[clear]).max(axis=1)
    above = np.einsum("nvk,nk->nv", vb[clear], w.normal[clear]).min(axis=1)
    assert (below <= w.offset[clear] + tolerance).all()
    assert (above >= w.offset[clear] - tolerance).all()
    np.testing.assert_allclose(np.linalg.norm(w.normal[clear], axis=1), 1, rtol=1e-14)
    for side, vertices in ((a, va), (b, vb)):
        near = Boxes(w.point[result.hit], np.full((result.hit.sum(), 3), tolerance),
                     np.broadcast_to(np.eye(3), (result.hit.sum(), 3, 3)))  # fmt: skip
        count = vertices.shape[1]
        mine = Hulls(vertices[result.hit].reshape(-1, 3), count * np.arange(result.hit.sum() + 1))
        assert overlap(mine, near, "abfme").hit.all(), type(side).__name__


@pytest.mark.parametrize("method", ["abfme", "auto"])
def test_threads_change_nothing(method):
    rng = np.random.default_rng(9)
    a, b = KINDS["tetrahedra"](rng, 20_000), KINDS["boxes"](rng, 20_000)
    one = overlap(a, b, method)
    for threads in (2, 5):
        np.testing.assert_array_equal(overlap(a, b, method, threads=threads).hit, one.hit)


@pytest.mark.skipif(not _rigid.has_avx2(), reason="this machine has the portable path only")
@pytest.mark.parametrize(("kind_a", "kind_b"), PAIRS)
def test_portable_path_gives_the_same_bits(kind_a, kind_b):
    rng = np.random.default_rng(21)
    a, b = KINDS[kind_a](rng, 2003), KINDS[kind_b](rng, 2003)
    d = rng.uniform(-2, 2, (2003, 3))

    def answers():
        results = [overlap_by(a, b, m) for m in ("abfme", "sat", "auto", "sat_textbook")]
        return [*results, native_sweep(a, b, d, "abfme"), native_sweep(a, b, d, "sat")]

    vectors = answers()
    with portable():
        assert not _rigid.has_avx2()
        plain = answers()
    for x, y in zip(vectors, plain, strict=True):
        for u, v in zip(x, y, strict=True):
            np.testing.assert_array_equal(u, v)


def test_box_batch_settles_random_pairs_and_gets_contacts_right():
    a, b = (KINDS["boxes"](np.random.default_rng(seed), 5003) for seed in (1, 2))
    hit, left = native_overlap(a, b, "auto")
    assert left == 0
    np.testing.assert_array_equal(hit, native_overlap(a, b, "abfme")[0])


@pytest.mark.parametrize("mode", [1, 2, 3])
def test_rounding_mode_of_the_caller_changes_nothing(mode):
    a, b = HARD["gaps 1e-12"](np.random.default_rng(1), 500)
    expected = overlap(a, b).hit
    try:
        _geometry.set_rounding(mode)
        got = [native_overlap(a, b, method)[0] for method in EXACT_METHODS]
        left = _geometry.get_rounding()
    finally:
        _geometry.set_rounding(0)
    assert left == mode
    for hit in got:
        np.testing.assert_array_equal(hit, expected)


def test_bad_arguments():
    a, b = Tetrahedra(np.zeros((3, 4, 3))), Tetrahedra(np.zeros((2, 4, 3)))
    with pytest.raises(ValueError, match="b: 2 bodies against 3; expected the same number, or 1"):
        overlap(a, b)
    with pytest.raises(ValueError, match="method: an array; poses are passed by name, `pose_a=`"):
        overlap(a, a, np.eye(4))
    with pytest.raises(ValueError, match="method: 'fast', expected one of abfme, sat, auto"):
        overlap(a, a, method="fast")
    with pytest.raises(ValueError, match="b: ndarray, expected one of Tetrahedra"):
        overlap(a, np.zeros((3, 4, 3)))
    with pytest.raises(ValueError, match="threads: -1"):
        overlap(a, a, threads=-1)
    none = Tetrahedra(np.zeros((0, 4, 3)))
    assert (
        overlap(none, none).hit.shape
        == overlap(none, Tetrahedra(np.zeros((1, 4, 3)))).hit.shape
        == (0,)
    )
