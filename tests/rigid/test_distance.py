"""Signed distance against rational arithmetic: right sign, right length, points that show it."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from oracles.convex_bodies import HARD, KINDS
from oracles.convex_distance import exact_distance, extent
from oracles.moving_bodies import as_hulls
from tauguard.rigid import Boxes, Capsules, Hulls, Polygons, Rounded, Spheres, Tetrahedra, distance
from tauguard.rigid import overlap as overlap_of

TOLERANCE = 3e-14


def check(a, b, rows=None):
    """Distances of the chosen rows against the truth, and points against distances, of all."""
    got = distance(a, b)
    for i in range(len(got.distance)) if rows is None else rows:
        want, size = exact_distance(a, b, i), extent(a, b, i)
        assert abs(got.distance[i] - want) <= TOLERANCE * size, i
        assert np.sign(got.distance[i]) == np.sign(want), i
        between = got.point_b[i] - got.point_a[i]
        scale = max(size, np.abs(got.point_a[i]).max())
        assert np.abs(between - got.distance[i] * got.normal[i]).max() <= 1e-12 * scale, i
    np.testing.assert_allclose(np.linalg.norm(got.normal, axis=1), 1, rtol=1e-12)
    return got


@pytest.mark.parametrize(
    ("kind_a", "kind_b"),
    [("tetrahedra", "tetrahedra"), ("boxes", "tetrahedra"), ("parallelepipeds", "tetrahedra")],
)
def test_random_bodies(kind_a, kind_b):
    rng = np.random.default_rng(51)
    a, b = KINDS[kind_a](rng, 2000), KINDS[kind_b](rng, 2000)
    tets = kind_a == "tetrahedra"
    got = check(a, b, range(60) if tets else range(2))
    np.testing.assert_array_equal(got.distance <= 0, overlap_of(a, b).hit)
    back = distance(b, a)
    np.testing.assert_allclose(back.distance, got.distance, atol=1e-13)


@pytest.mark.parametrize("name", HARD)
def test_hard_cases_have_the_sign_of_the_exact_overlap(name):
    a, b = HARD[name](np.random.default_rng(52), 60)
    got = check(a, b, range(12) if isinstance(a, Tetrahedra) and isinstance(b, Tetrahedra) else ())
    np.testing.assert_array_equal(got.distance <= 0, overlap_of(a, b).hit)


@pytest.mark.parametrize("scale", [1e-150, 1e-30, 1e30, 1e90])
def test_any_scale(scale):
    a, b = (KINDS["tetrahedra"](np.random.default_rng(seed), 20) for seed in (53, 54))
    unit = distance(a, b).distance
    got = distance(Tetrahedra(a.vertices * scale), Tetrahedra(b.vertices * scale)).distance
    np.testing.assert_allclose(got / scale, unit, rtol=1e-9, atol=1e-13)


numbers = st.one_of(st.integers(-2, 2).map(float), st.floats(-1e3, 1e3, width=16))


@settings(max_examples=60, deadline=None)
@given(st.lists(numbers, min_size=24, max_size=24))
def test_any_tetrahedra(values):
    v = np.array(values).reshape(2, 1, 4, 3)
    check(Tetrahedra(v[0]), Tetrahedra(v[1]))


def test_points_lie_on_the_bodies():
    rng = np.random.default_rng(55)
    a, b = KINDS["boxes"](rng, 500), KINDS["tetrahedra"](rng, 500)
    got = distance(a, b)
    for body, points in ((a, got.point_a), (b, got.point_b)):
        off = distance(body, Spheres(points, 0.0)).distance
        assert np.abs(off).max() < 1e-12  # neither outside nor inside


def test_moved_by_the_depth_the_bodies_only_touch():
    rng = np.random.default_rng(56)
    a, b = KINDS["boxes"](rng, 300), KINDS["tetrahedra"](rng, 300)
    got = distance(a, b)
    deep = got.distance < 0
    assert deep.sum() > 50
    way = np.where(deep, -got.distance, 0)[:, None] * got.normal
    assert np.abs(distance(a, Tetrahedra(b.vertices + way[:, None])).distance[deep]).max() < 1e-13


def test_hulls_flat_ones_and_single_points():
    rng = np.random.default_rng(57)
    a = as_hulls([rng.integers(-2, 3, (rng.integers(1, 6), 3)).astype(float) for _ in range(80)])
    b = as_hulls([rng.integers(-2, 3, (rng.integers(1, 5), 3)).astype(float) for _ in range(80)])
    check(a, b)
    flat = Hulls(np.c_[rng.uniform(-1, 1, (40, 2)), np.zeros(40)], 4 * np.arange(11))
    other = Hulls(np.c_[rng.uniform(-1, 1, (40, 2)), np.zeros(40)], 4 * np.arange(11))
    got = check(flat, other)
    meet = got.distance == 0
    assert meet.any()
    np.testing.assert_allclose(np.abs(got.normal[meet, 2]), 1, rtol=1e-15)


def test_spheres_and_capsules_by_formula():
    rng = np.random.default_rng(58)
    p, q, s, t = rng.normal(size=(4, 300, 3))
    r, u = rng.uniform(0, 0.8, (2, 300))
    got = check(Spheres(p, r), Spheres(q, u))
    np.testing.assert_allclose(got.distance, np.linalg.norm(p - q, axis=1) - r - u, atol=1e-14)
    check(Capsules(p, s, r), Capsules(q, t, u))
    check(Capsules(p, s, r), Spheres(q, u))
    # A capsule without length is a sphere, a radius of zero the core itself.
    np.testing.assert_array_equal(
        distance(Capsules(p, p, r), Spheres(q, u)).distance,
        distance(Spheres(p, r), Spheres(q, u)).distance,
    )
    np.testing.assert_array_equal(
        distance(Capsules(p, s, 0), Spheres(q, 0)).distance,
        distance(Capsules(p, s, 0).core, Spheres(q, 0).core).distance,
    )


def test_concentric_and_crossing_rounded_bodies():
    origin = np.zeros((1, 3))
    assert distance(Spheres(origin, 2.0), Spheres(origin, 1.0)).distance[0] == -3.0
    x, y = np.array([[1.0, 0, 0]]), np.array([[0, 1.0, 0]])
    got = distance(Capsules(-x, x, 0.25), Capsules(-y, y, 0.5))
    assert got.distance[0] == -0.75
    assert abs(got.normal[0, 2]) == 1.0
    parallel = distance(Capsules(-x, x, 0.25), Capsules(0 * x, 3 * x, 0.25))
    assert parallel.distance[0] == -0.5
    assert parallel.normal[0, 0] == 0.0


def test_rounded_boxes_touch_exactly():
    eye = np.eye(3)[None]
    box = Rounded(Boxes([[0, 0, 0]], [[0.5, 0.5, 0.5]], eye), 0.25)
    for step, sign in ((0.0, 0), (2.0**-52, 1), (-(2.0**-52), -1)):
        ball = Spheres([[1.0 + step, 0, 0]], 0.25)
        assert np.sign(distance(box, ball).distance[0]) == sign
    corner = Spheres([[0.5 + 0.75, 0.5 + 1.0, 0.5]], 1.0)  # 3-4-5: on the edge, exactly
    assert distance(box, corner).distance[0] == 0.0


def test_far_from_the_origin_nothing_is_lost():
    rng = np.random.default_rng(59)
    center, half = rng.integers(-4, 5, (200, 3)) / 2, rng.integers(1, 5, (200, 3)) / 4
    eye, far = np.tile(np.eye(3), (200, 1, 1)), np.array([2.0**40, -(2.0**41), 2.0**40])
    here = distance(Boxes(np.zeros((200, 3)), half, eye), Boxes(center, half, eye))
    there = distance(Boxes(np.tile(far, (200, 1)), half, eye), Boxes(center + far, half, eye))
    np.testing.assert_allclose(there.distance, here.distance, atol=1e-14)


def test_axis_parallel_boxes_whose_edges_differ_by_up_to_1e24():
    """Flat boxes, needles and points beside large ones: their intervals tell the truth."""
    rng, count = np.random.default_rng(57), 8000
    half = 10.0 ** rng.uniform(-12, 12, (2, count, 1)) * 10.0 ** rng.uniform(-12, 0, (2, count, 3))
    half[0, ::5, 0], half[1, ::6] = 0, 0
    center = half.sum(axis=0) * rng.normal(size=(count, 3))
    identity = np.broadcast_to(np.eye(3), (count, 3, 3))
    a, b = Boxes(center, half[0], identity), Boxes(np.zeros((count, 3)), half[1], identity)
    sign = np.empty(count)
    for i in range(count):
        rows = (map(Fraction, x.tolist()) for x in (center[i], half[0, i], half[1, i]))
        gap = max(abs(c) - p - q for c, p, q in zip(*rows, strict=True))
        sign[i] = (gap > 0) - (gap < 0)
    for first, second in ((a, b), (b, a)):
        np.testing.assert_array_equal(np.sign(distance(first, second).distance), sign)


def test_threads_change_nothing():
    a, b = (KINDS["boxes"](np.random.default_rng(seed), 500) for seed in (60, 61))
    one = distance(a, b)
    for threads in (2, 5):
        many = distance(a, b, threads=threads)
        for name in ("distance", "point_a", "point_b", "normal"):
            np.testing.assert_array_equal(getattr(many, name), getattr(one, name))


def test_bad_arguments():
    ball = Spheres(np.zeros((2, 3)), 1.0)
    with pytest.raises(ValueError, match=r"radius: -1\.0 in row 1"):
        Spheres(np.zeros((2, 3)), [1, -1])
    with pytest.raises(ValueError, match=r"radius: shape \(3,\), expected \(2\)"):
        Spheres(np.zeros((2, 3)), [1, 1, 1])
    with pytest.raises(ValueError, match="core: Spheres, expected convex bodies"):
        Rounded(ball, 0.1)
    flat = Polygons(np.eye(3, 2), [0, 3])
    with pytest.raises(ValueError, match="a: Polygons, expected bodies in space"):
        distance(flat, flat)
    with pytest.raises(ValueError, match="b: a number beyond 1e100"):
        distance(ball, Spheres(np.full((2, 3), 1e101), 1.0))
    with pytest.raises(ValueError, match="b: 3 bodies against 2"):
        distance(ball, Spheres(np.zeros((3, 3)), 1.0))
    assert distance(ball, ball).within(-1.5).all()
    for wrong in (np.nan, "a", None):
        with pytest.raises(ValueError, match="min_distance"):
            distance(ball, ball).within(wrong)
