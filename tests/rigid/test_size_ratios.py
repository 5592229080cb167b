"""Distances of bodies whose sizes differ by any factor, against rational arithmetic."""

import numpy as np
import pytest

from oracles import size_ratios
from oracles.convex_distance import exact_distance
from tauguard.rigid import Capsules, Hulls, Rounded, Tetrahedra, distance, overlap

SMALL = np.array([[-4.0, -6, 3], [-6, -1, 0], [-4, -7, 3], [6, -7, 9]])
LONG = np.array([[4.0, -7, -8], [-4e8, 3e8, 6e8]])


def small_and_long():
    return Tetrahedra(SMALL[None]), Hulls(LONG, [0, 2])


@pytest.mark.parametrize("axes", [(0, 1, 2), (1, 2, 0), (2, 1, 0)])
@pytest.mark.parametrize("scale", [1.0, 2.0**-100, 2.0**60])
def test_a_segment_that_passes_a_tetrahedron_of_a_hundred_millionth_of_its_length(axes, scale):
    small, long = (
        Tetrahedra(scale * SMALL[None][..., axes]),
        Hulls(scale * LONG[:, axes], [0, 2]),
    )
    truth = exact_distance(small, long, 0)
    assert truth / scale == pytest.approx(0.62099, abs=1e-5)
    for pair in ((small, long), (long, small)):
        got = distance(*pair)
        assert got.distance[0] > 0
        assert abs(got.distance[0] - truth) < size_ratios.BOUND * scale * 8e8


def test_radii_beside_it():
    small, long = small_and_long()
    truth = exact_distance(small, long, 0)
    for radius, sign in ((0.25, 1), (0.75, -1)):
        capsule = Capsules(LONG[:1], LONG[1:], radius)
        for pair in ((small, capsule), (Rounded(small, radius), long), (capsule, small)):
            assert np.sign(distance(*pair).distance[0]) == sign
            assert overlap(*pair).hit[0] == (sign < 0)
            assert distance(*pair).distance[0] == pytest.approx(truth - radius, abs=3e-5)


def test_a_depth_beside_it():
    """The same shapes in each other: the depth is right too."""
    small = small_and_long()[0]
    inside = Hulls(LONG - LONG[0] + SMALL.mean(axis=0), [0, 2])
    truth = exact_distance(small, inside, 0)
    assert truth < 0
    for pair in ((small, inside), (inside, small)):
        assert abs(distance(*pair).distance[0] - truth) < size_ratios.BOUND * 8e8


@pytest.mark.parametrize("kind", size_ratios.KINDS)
def test_any_kinds_of_any_ratio(kind):
    rng = np.random.default_rng(71)
    for other in size_ratios.KINDS:
        for _ in range(2):
            a, b = size_ratios.pair(rng, (kind, other))
            got = size_ratios.judged(a, b, int(rng.integers(-100, 101)))
            assert not got.signs, (a, b)
            assert got.error <= size_ratios.BOUND, (a, b)


def test_integer_tetrahedra_against_segments_of_a_billion():
    """The draws of which one in thirty had a wrong sign."""
    rng = np.random.default_rng(72)
    small = Tetrahedra(rng.integers(-9, 10, (300, 4, 3)).astype(float))
    ends = rng.integers(-9, 10, (300, 2, 3)).astype(float)
    ends[:, 1] *= 10.0 ** rng.integers(7, 11, (300, 1))
    long = Hulls(ends.reshape(-1, 3), 2 * np.arange(301))
    hit = overlap(small, long).hit
    np.testing.assert_array_equal(distance(small, long).distance <= 0, hit)
    np.testing.assert_array_equal(distance(long, small).distance <= 0, hit)
