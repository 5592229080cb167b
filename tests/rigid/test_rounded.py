"""Overlap and time of impact of bodies with radii: rational arithmetic, formulas, bisection."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from oracles.convex_bodies import KINDS
from oracles.convex_distance import exactly_meet
from oracles.moving_bodies import EYE, REST, corners_of, motions, placed, rounded
from tauguard.rigid import (
    Boxes,
    Capsules,
    Hulls,
    Motion,
    Rounded,
    Spheres,
    Tetrahedra,
    distance,
    overlap,
    sweep,
    time_of_impact,
)
from tauguard.rigid.rounded import parts

BIG = 2.0**266


def check_overlap(a, b):
    got = overlap(a, b)
    want = [exactly_meet(a, b, i) for i in range(len(got.hit))]
    np.testing.assert_array_equal(got.hit, want)
    witness = got.witness
    for body in (a, b):  # a common point lies in both bodies
        inside = distance(body, Spheres(np.nan_to_num(witness.point), 0.0)).distance
        assert (inside[got.hit] <= 1e-9).all()
    assert np.isnan(witness.normal[got.hit]).all()
    assert np.isnan(witness.point[~got.hit]).all()
    return got


numbers = st.one_of(st.integers(-2, 2).map(float), st.floats(-1e3, 1e3, width=16))
radii = st.one_of(st.sampled_from([0.0, 0.5, 1.0, 5.0]), st.floats(0, 1e3, width=16))


@settings(max_examples=80, deadline=None)
@given(st.lists(numbers, min_size=12, max_size=12), radii, radii)
def test_any_capsules(values, r, s):
    p = np.array(values).reshape(4, 1, 3)
    check_overlap(Capsules(p[0], p[1], r), Capsules(p[2], p[3], s))
    check_overlap(Capsules(p[0], p[1], r), Spheres(p[2], s))
    check_overlap(Spheres(p[0], r), Spheres(p[2], s))


@settings(max_examples=30, deadline=None)
@given(st.lists(numbers, min_size=18, max_size=18), radii, radii)
def test_any_rounded_tetrahedra_and_capsules(values, r, s):
    v = np.array(values).reshape(6, 3)
    check_overlap(Rounded(Tetrahedra(v[None, :4]), r), Capsules(v[4:5], v[5:6], s))


@pytest.mark.parametrize(
    ("a", "b", "hit"),
    [
        (Spheres([[0, 0, 0]], 1.0), Spheres([[0, 0, 0]], 1.0), True),
        (Spheres([[0, 0, 0]], 0.0), Spheres([[0, 0, 0]], 0.0), True),
        (Spheres([[0, 0, 0]], 2.0), Spheres([[3, 4, 0]], 3.0), True),
        (Spheres([[0, 0, 0]], 2.0), Spheres([[3, 4, 0]], np.nextafter(3.0, 0)), False),
        (Spheres([[0, 0, 0]], 0.0), Spheres([[0, 0, 5e-324]], 0.0), False),
        (Spheres([[1e90, 0, 0]], 0.0), Spheres([[1e90, 3 * BIG, 4 * BIG]], 5 * BIG), True),
        (Capsules([[0, 0, 0]], [[0, 0, 0]], 1.0), Spheres([[2, 0, 0]], 1.0), True),
        (Capsules([[-1, 0, 0]], [[1, 0, 0]], 0.5), Capsules([[0, -1, 1]], [[0, 1, 1]], 0.5), True),
        (Capsules([[-1, 0, 0]], [[1, 0, 0]], 0), Capsules([[0, -1, 0]], [[0, 1, 0]], 0), True),
        (Capsules([[-1, 0, 0]], [[1, 0, 0]], 0), Capsules([[2, 0, 0]], [[3, 0, 0]], 1), True),
        (Rounded(Boxes([[0, 0, 0]], [[1, 1, 0]], EYE), 0.5), Spheres([[0, 0, 1.5]], 1), True),
        (Rounded(Boxes([[0, 0, 0]], [[1, 1, 1]], EYE), 0), Spheres([[0, 0, 2.0]], 1), True),
        (Rounded(Boxes([[0, 0, 0]], [[0, 0, 0]], EYE), 1), Spheres([[0, 0, 2.5]], 1), False),
        (Spheres([[0, 0, 0]], 10.0), Tetrahedra(np.eye(4, 3)[None]), True),
    ],
    ids=[
        "concentric", "coincident points", "touching 3-4-5", "one bit short", "least apart", "huge",
        "capsule without length", "crossing capsules touch", "segments cross", "in one line",
        "rounded plate touches", "radius zero touches", "box without size", "one in the other",
    ],
)  # fmt: skip
def test_degenerate_cases(a, b, hit):
    assert overlap(a, b).hit.tolist() == [hit]
    assert overlap(b, a).hit.tolist() == [hit]
    if len(parts(a)[0].packed) < 3:
        check_overlap(a, b)


def test_random_rounded_bodies_agree_with_their_distance():
    rng = np.random.default_rng(70)
    for kind in ("boxes", "tetrahedra", "parallelepipeds"):
        a, b = KINDS[kind](rng, 1500), KINDS[kind](rng, 1500)
        r, s = rng.uniform(0, 0.3, (2, 1500))
        got = overlap(Rounded(a, r), Rounded(b, s))
        np.testing.assert_array_equal(got.hit, distance(Rounded(a, r), Rounded(b, s)).distance <= 0)
        np.testing.assert_array_equal(overlap(Rounded(a, 0), b).hit, overlap(a, b).hit)
        w = got.witness
        for body, radius, sign in ((a, r, 1), (b, s, -1)):
            inside = distance(Rounded(body, radius), Spheres(np.nan_to_num(w.point), 0)).distance
            assert (inside[got.hit] <= 1e-12).all()
            center = body.center if kind == "boxes" else body.packed[:, :3]
            side = sign * (w.offset - np.einsum("ij,ij->i", w.normal, center))
            assert (side[~got.hit] >= 0).all()


def test_other_methods_and_queries_say_what_they_take():
    ball, box = Spheres([[0, 0, 0]], 1.0), Boxes([[0, 0, 0]], [[1, 1, 1]], EYE)
    with pytest.raises(ValueError, match="'sat' needs bodies without radii, but a is a"):
        overlap(ball, box, "sat")
    with pytest.raises(ValueError, match="b: Spheres, expected Tetrahedra, Boxes"):
        sweep(box, ball, [1, 0, 0])
    with pytest.raises(ValueError, match="b: str, expected one of Tetrahedra"):
        overlap(ball, "box")  # type: ignore[call-overload]


def bisected(a, b, ma, mb, samples=60):
    """The first time at which the distance is not above zero, inf where no sample says so."""
    pa, pb = corners_of(a), corners_of(b)

    def gap(t):
        return distance(placed(a, ma, t, pa), placed(b, mb, t, pb)).distance

    apart = np.array([gap(t) for t in np.linspace(0, 1, samples + 1)]) > 0
    first = (~apart).argmax(axis=0)
    hi, lo = first / samples, np.maximum(first - 1, 0) / samples
    for _ in range(40):
        middle = 0.5 * (lo + hi)
        hit = gap(middle) <= 0
        lo, hi = np.where(hit, lo, middle), np.where(hit, middle, hi)
    return np.where((~apart).any(axis=0), hi, np.inf)


PAIRS = [
    ("spheres", "spheres"),
    ("capsules", "capsules"),
    ("rounded boxes", "capsules"),
    ("boxes", "spheres"),
    ("tetrahedra", "rounded boxes"),
]


@pytest.mark.parametrize("kinds", PAIRS, ids=["-".join(pair) for pair in PAIRS])
def test_time_of_impact_is_never_late_never_missed_and_close(kinds):
    rng = np.random.default_rng(71)
    n = 60
    a, b = (rounded(kind, rng, n) for kind in kinds)
    ma, mb = motions(rng, n, 1.2), motions(rng, n, 1.2)
    aim = ma.pose_t0[:, :3, 3] - mb.pose_t0[:, :3, 3] + rng.uniform(-0.3, 0.3, (n, 3))
    ma, mb = Motion(ma.pose_t0, 0 * aim, ma.angular), Motion(mb.pose_t0, aim, mb.angular)
    got, truth = time_of_impact(a, b, ma, mb), bisected(a, b, ma, mb)
    hit = np.isfinite(truth)
    assert hit.sum() >= 10
    assert got.hit[hit].all()
    assert (got.time_of_impact[hit] <= truth[hit] + 1e-11).all()
    assert (
        truth[hit] - got.time_of_impact[hit] <= 1e-9
    ).mean() > 0.95  # a graze between two samples
    np.testing.assert_array_equal(got.time_of_impact == 0, truth <= 0)
    t = np.where(got.hit, got.time_of_impact, 0.0)
    later = got.hit & (got.time_of_impact > 0)
    np.testing.assert_allclose(np.linalg.norm(got.normal[later], axis=1), 1.0)
    # Up to there they are apart, by less than the rest of the way.
    left = distance(placed(a, ma, t), placed(b, mb, t))
    assert np.abs(left.distance[later]).max() < 1e-9
    np.testing.assert_allclose(left.normal[later], got.normal[later], atol=1e-5)
    for body, motion in ((a, ma), (b, mb)):
        point = Spheres(np.nan_to_num(got.point), 0)
        assert distance(placed(body, motion, t), point).distance[got.hit].max() < 1e-8


def test_balls_on_straight_ways_by_formula():
    rng = np.random.default_rng(72)
    n = 300
    p, d = rng.normal(size=(2, n, 3))
    p, d, r = 3 * p, 0.7 * d - 3 * p, rng.uniform(0, 1, n)
    pose = np.tile(np.eye(4), (n, 1, 1))
    pose[:, :3, 3] = p
    got = time_of_impact(
        Spheres([[0, 0, 0]], 0.5), Spheres(np.zeros((n, 3)), r), REST, Motion(pose, d, np.zeros(3))
    )
    a, b, c = (d * d).sum(1), (p * d).sum(1), (p * p).sum(1) - (r + 0.5) ** 2
    disc = b * b - a * c
    root = (-b - np.sqrt(np.maximum(disc, 0))) / a
    want = np.where(c <= 0, 0.0, np.where((disc >= 0) & (root >= 0) & (root <= 1), root, np.inf))
    assert np.isfinite(want).sum() > 30
    np.testing.assert_allclose(got.time_of_impact, want, atol=1e-9)


def test_a_spinning_capsule_reaches_a_ball_at_the_angle_that_geometry_says():
    # The capsule's axis turns at 2 rad a step; the ball's centre stays 1 from the origin at angle
    # 1, so they touch where sin(1 - angle) is the sum of the radii.
    spin = Motion(np.eye(4), np.zeros(3), [0, 0, 2.0])
    rod = Capsules([[0, 0, 0]], [[2, 0, 0]], 0.125)
    ball = Spheres([[np.cos(1), np.sin(1), 0]], 0.25)
    got = time_of_impact(rod, ball, spin, REST)
    want = brentq(lambda t: np.sin(1 - 2 * t) - 0.375, 0, 0.5)
    np.testing.assert_allclose(got.time_of_impact, want, atol=1e-12)


def test_motions_that_touch_overlap_or_stand_still():
    one, rest = Spheres([[0, 0, 0]], 1.0), REST
    two = Spheres([[2, 0, 0]], 1.0)
    away = Motion(np.eye(4), [1.0, 0, 0], np.zeros(3))
    assert time_of_impact(one, two, rest, away).time_of_impact[0] == 0  # touching at the start
    same = time_of_impact(one, one, rest, rest)
    assert same.time_of_impact[0] == 0
    assert np.isnan(same.normal).all()
    assert np.isfinite(same.point).all()
    apart = Spheres([[2 + 1e-9, 0, 0]], 1.0)
    assert not time_of_impact(one, apart, rest, rest).hit[0]
    assert not time_of_impact(one, apart, rest, away).hit[0]
    point = Spheres([[3, 0, 0]], 0.0)  # a ball of no radius is a point
    toward = Motion(np.eye(4), [-4.0, 0, 0], np.zeros(3))
    np.testing.assert_allclose(
        time_of_impact(one, point, rest, toward).time_of_impact, 0.5, atol=1e-12
    )
    tiny = Rounded(Hulls([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [0, 3]), 1e-13)
    drop = Motion(np.eye(4), [0, 0, -4.0], np.zeros(3))
    got = time_of_impact(tiny, Spheres([[0.2, 0.2, 2]], 0.0), rest, drop)
    np.testing.assert_allclose(got.time_of_impact, 0.5, atol=1e-10)


def test_radius_zero_is_the_core_and_threads_change_nothing():
    rng = np.random.default_rng(73)
    a, b = (rounded("boxes", rng, 100) for _ in range(2))
    ma, mb = motions(rng, 100, 1.5), motions(rng, 100, 1.5)
    sharp, zero = time_of_impact(a, b, ma, mb), time_of_impact(Rounded(a, 0.0), b, ma, mb)
    for name in ("hit", "time_of_impact", "point", "normal"):
        assert getattr(sharp, name).tobytes() == getattr(zero, name).tobytes()
    c = rounded("capsules", rng, 100)
    one = time_of_impact(c, b, ma, mb), overlap(c, b).hit
    for threads in (2, 5):
        many = time_of_impact(c, b, ma, mb, threads=threads), overlap(c, b, threads=threads).hit
        assert one[0].time_of_impact.tobytes() == many[0].time_of_impact.tobytes()
        np.testing.assert_array_equal(one[1], many[1])
