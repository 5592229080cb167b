"""Degenerate bodies and triangles that touch: the points of every result are in both."""

import numpy as np
import pytest

from oracles.touching_pairs import KINDS, distance_to_feature, touching
from tauguard.rigid import (
    Capsules,
    Hulls,
    MeshTree,
    Motion,
    distance,
    overlap,
    sweep,
    time_of_impact,
)

COUNT = 30
#: Rounding of points, in units of the largest coordinate of these pairs, about 8.
ROUNDING = 2.0**-40


def features(kind, seed=0):
    """Corners of both features at the start, and the relative displacement of the second one."""
    vertex, x_t0, x_t1 = touching(kind, seed, COUNT)
    first = 1 if vertex else 2
    moved = x_t1 - x_t0
    return x_t0[:, :first], x_t0[:, first:], moved[:, -1] - moved[:, 0]


def at_contact(kind, seed=0):
    """Corners of both features, where they touch."""
    vertex, at = KINDS[kind][0], KINDS[kind][1](np.random.default_rng(seed), COUNT)
    return (at[:, :1], at[:, 1:]) if vertex else (at[:, :2], at[:, 2:])


def hulls(corners):
    n, k = corners.shape[:2]
    return Hulls(corners.reshape(-1, 3), np.arange(0, n * k + 1, k))


def mesh(corners):
    """One triangle per row; a feature of fewer corners is a degenerate triangle."""
    faces = np.minimum(np.arange(3), corners.shape[1] - 1)
    rows = corners.shape[1] * np.arange(len(corners))[:, None] + faces
    return MeshTree(corners.reshape(-1, 3), rows)


def assert_in_both(point, a, b, tolerance=ROUNDING):
    assert distance_to_feature(point, a).max() < tolerance
    assert distance_to_feature(point, b).max() < tolerance


@pytest.mark.parametrize("kind", KINDS)
def test_hulls_that_touch(kind):
    a, b = at_contact(kind)
    gaps = distance(hulls(a), hulls(b))
    assert (gaps.distance == 0).all()
    assert_in_both(gaps.point_a, a, b)
    assert_in_both(gaps.point_b, a, b)
    np.testing.assert_allclose(np.linalg.norm(gaps.normal, axis=1), 1, atol=1e-12)
    meeting = overlap(hulls(a), hulls(b))
    assert meeting.hit.all()
    assert_in_both(meeting.witness.point, a, b)


@pytest.mark.parametrize("kind", KINDS)
def test_hulls_that_move(kind):
    a, b, moves = features(kind)
    identity = np.tile(np.eye(4), (COUNT, 1, 1))
    rest = Motion(np.eye(4), np.zeros(3), np.zeros(3))
    for found, early in (
        (sweep(hulls(a), hulls(b), moves), 1e-9),
        (time_of_impact(hulls(a), hulls(b), rest, Motion(identity, moves, np.zeros(3))), 1e-8),
    ):
        assert found.hit.all()
        reached = b + (found.time_of_impact[:, None] * moves)[:, None]
        assert_in_both(found.point, a, reached, 16 * early)


@pytest.mark.parametrize("kind", KINDS)
def test_meshes_that_touch(kind):
    a, b = at_contact(kind)
    apart = 32.0 * np.arange(COUNT)[:, None, None] * np.array([1, 0, 0])
    contacts = mesh(a + apart).contacts(mesh(b + apart), np.eye(4))
    assert np.array_equal(contacts.faces, np.arange(COUNT)[:, None].repeat(2, axis=1))
    assert_in_both(contacts.point - apart[:, 0], a, b, 32 * COUNT * 2.0**-45)
    assert contacts.penetration.max() < ROUNDING


@pytest.mark.parametrize("kind", KINDS)
def test_meshes_that_move(kind):
    a, b, moves = features(kind)
    for k in range(10):
        found = mesh(a[k : k + 1]).sweep(mesh(b[k : k + 1]), np.eye(4), moves[k])
        assert found.hit[0]
        reached = b[k : k + 1] + found.time_of_impact[0] * moves[k]
        assert_in_both(found.point, a[k : k + 1], reached, 1e-7)


@pytest.mark.parametrize("kind", KINDS)
def test_a_mesh_and_bodies_that_touch(kind):
    a, b = at_contact(kind)
    for k in range(5):
        one = slice(k, k + 1)
        gaps = distance(mesh(a[one]), hulls(b[one]))
        assert gaps.distance[0] == 0
        assert_in_both(gaps.point_a, a[one], b[one])
        assert_in_both(gaps.point_b, a[one], b[one])


def test_parallel_capsules():
    """Axes that are parallel, with an overlap: the points are the radii apart from both axes."""
    ends = np.array([[[0, 0, 0], [4, 0, 0]], [[1, 0, 2], [9, 0, 2.0]]])
    a, b = (Capsules(e[:1], e[1:], 0.5) for e in ends)
    gaps = distance(a, b)
    assert gaps.distance[0] == 1
    np.testing.assert_allclose(gaps.point_b - gaps.point_a, [[0, 0, 1]], atol=1e-15)
    assert 1 <= gaps.point_a[0, 0] <= 4
