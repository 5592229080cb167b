"""Orientation signs against exact rationals."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.geometry import _geometry, orient2d, orient3d

finite_doubles = st.floats(allow_nan=False, allow_infinity=False, width=64)


def exact_orient3d(points) -> int:
    a, b, c, d = [[Fraction(float(x)) for x in p] for p in points]
    u, v, w = ([x - y for x, y in zip(p, a, strict=True)] for p in (b, c, d))
    det = (
        (u[1] * v[2] - u[2] * v[1]) * w[0]
        + (u[2] * v[0] - u[0] * v[2]) * w[1]
        + (u[0] * v[1] - u[1] * v[0]) * w[2]
    )
    return (det > 0) - (det < 0)


@settings(max_examples=300, deadline=None)
@given(st.lists(finite_doubles, min_size=12, max_size=12))
def test_orient3d_is_exact_for_any_double(numbers):
    points = np.array(numbers).reshape(1, 4, 3)
    assert orient3d(points)[0] == exact_orient3d(points[0])


@pytest.mark.parametrize("scale", [1.0, 2.0**-300, 2.0**300, 1e-320])
@pytest.mark.parametrize("offset", [0.0, 1e10])
def test_near_coplanar_points(scale, offset):
    rng = np.random.default_rng(5)
    base = rng.integers(-4, 5, (2000, 4, 3)).astype(float)
    base[:, 3] = base[:, 0] + (base[:, 1] - base[:, 0]) * 0.5 + (base[:, 2] - base[:, 0]) * 0.25
    base[::2, 3, 0] = np.nextafter(base[::2, 3, 0], np.inf)
    points = (base + offset) * scale
    expected = [exact_orient3d(p) for p in points]
    assert {-1, 0, 1} >= set(expected)
    np.testing.assert_array_equal(orient3d(points), expected)


def test_orient2d_on_a_line():
    t = np.arange(1000.0)
    points = np.stack([np.c_[t, t], np.c_[t + 1, t + 1], np.c_[t + 2, t + 2]], axis=1)
    assert (orient2d(points) == 0).all()
    points[:, 2, 1] = np.nextafter(points[:, 2, 1], np.inf)
    assert (orient2d(points) == 1).all()


@pytest.mark.parametrize("mode", [1, 2, 3])
def test_rounding_mode_of_the_caller_changes_nothing_and_is_restored(mode):
    rng = np.random.default_rng(1)
    points = rng.normal(size=(5000, 4, 3))
    points[:, 3] = points[:, :3].mean(axis=1)
    expected = orient3d(points)
    try:
        _geometry.set_rounding(mode)
        got = orient3d(points, threads=2)
        left = _geometry.get_rounding()
    finally:
        _geometry.set_rounding(0)
    assert left == mode
    np.testing.assert_array_equal(got, expected)


def test_thread_count_changes_nothing():
    points = np.random.default_rng(2).normal(size=(50_000, 4, 3))
    reference = orient3d(points)
    for threads in (2, 3, 7):
        np.testing.assert_array_equal(orient3d(points, threads=threads), reference)


def test_bad_input_names_the_row():
    points = np.zeros((5, 4, 3))
    points[3, 1, 2] = np.nan
    with pytest.raises(ValueError, match=r"points: nan in row 3"):
        orient3d(points)
    with pytest.raises(ValueError, match=r"shape \(5, 4, 2\), expected \(N, 4, 3\)"):
        orient3d(np.zeros((5, 4, 2)))
