"""A core is what is left of a shape when a layer is taken off, and holds its centre."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from tauguard.contacts.guard.eroded_shapes import _Hull


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.5, 0.75, 0.95]))
@settings(max_examples=30, deadline=None)
def test_a_core_keeps_its_distance_from_every_face_and_is_as_large_as_that_allows(seed, share):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(12, 3)) * np.exp(rng.uniform(-3, 0, 3))
    points -= points.mean(axis=0)
    hull = _Hull(points)
    layer = share * hull.radius
    n, d = np.split(ConvexHull(points).equations, [3], axis=1)
    depth = -(hull.core(layer) @ n.T + d.T)  # of each corner below each face
    about_centre = (1 - share) * points
    own = np.array([not np.isclose(c, about_centre).all(axis=1).any() for c in hull.core(layer)])
    assert (depth[own] >= layer * (1 - 1e-6)).all()
    assert (np.sort(depth[own], axis=1)[:, :3] <= layer * (1 + 1e-6)).all()  # on three faces each
    assert (depth > 0).all()


def test_a_flat_mesh_is_all_core():
    square = np.array([[x, y, 0.0] for x in (-1, 1) for y in (-1, 1)])
    hull = _Hull(square)
    assert hull.radius == 0
    np.testing.assert_array_equal(hull.core(0.1), square)


def test_the_radius_of_a_brick_is_half_its_least_side():
    brick = np.array(
        [[x, y, z] for x in (-3, 3) for y in (-0.2, 0.2) for z in (-1, 1)], dtype=float
    )
    assert _Hull(brick).radius == pytest.approx(0.2)
