"""The broad phase misses no pair: beside brute force over distances, times and boxes."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.spatial.transform import Rotation

from tauguard.rigid import (
    Boxes,
    Capsules,
    Cones,
    Cylinders,
    Ellipsoids,
    HalfSpaces,
    Hulls,
    MeshTree,
    Motion,
    Parallelepipeds,
    Rounded,
    Spheres,
    Tetrahedra,
    distance,
    near_pairs,
    time_of_impact,
)


def listed(pairs):
    return set(map(tuple, pairs.tolist()))


def places(rng, n, size=4.0):
    pose = np.tile(np.eye(4), (n, 1, 1))
    pose[:, :3, :3] = Rotation.random(n, rng=rng).as_matrix()
    pose[:, :3, 3] = rng.uniform(-size, size, (n, 3))
    return pose


def every_kind(rng):
    """Batches of every bounded kind, three bodies each, and a mesh; the bodies one by one."""
    turns = Rotation.random(3, rng=rng).as_matrix()
    center, size = rng.uniform(-3, 3, (3, 3)), rng.uniform(0.1, 0.8, (3, 3))
    batches = [
        Tetrahedra(center[:, None] + rng.normal(size=(3, 4, 3))),
        Boxes(center + 1, size, turns),
        Parallelepipeds(center - 1, rng.normal(size=(3, 3, 3))),
        Hulls(rng.uniform(-2, 2, (15, 3)), [0, 5, 8, 15]),
        Spheres(center[::-1], size[:, 0]),
        Capsules(center, center + size, size[:, 1]),
        Rounded(Boxes(-center, size, turns), 0.2),
        Cylinders(center + 0.5, size[:, 0], size[:, 1], turns),
        Cones(center - 0.5, size[:, 0], size[:, 1], turns),
        Ellipsoids(center + np.array([2, 0, 0]), size, turns),
        MeshTree(rng.uniform(-1, 1, (6, 3)), [[0, 1, 2], [3, 4, 5]]),
    ]
    bodies = [b[k] for b in batches[:-1] for k in range(3)] + [batches[-1]]
    return batches, bodies


@pytest.mark.parametrize("margin", [0.0, 0.3])
def test_no_near_pair_of_any_kinds_is_missed(margin):
    for seed in range(3):
        batches, bodies = every_kind(np.random.default_rng(seed))
        pairs = near_pairs(batches, margin)
        near = {
            (i, j)
            for i, j in combinations(range(len(bodies)), 2)
            if distance(bodies[i], bodies[j]).distance[0] <= margin
        }
        assert near <= listed(pairs)
        assert len(near) > 20
        assert len(pairs) < 4 * len(near)


def test_poses_are_those_of_distance():
    rng = np.random.default_rng(3)
    batches, bodies = every_kind(rng)
    pose = places(rng, len(bodies), 1.0)
    pairs = listed(near_pairs(batches, 0.2, pose=pose))
    near = set()
    for i, j in combinations(range(len(bodies) - 1), 2):
        gap = distance(bodies[i], bodies[j], pose_a=pose[i], pose_b=pose[j]).distance[0]
        near |= {(i, j)} if gap <= 0.2 else set()
    assert near <= pairs
    assert len(near) > 10
    mesh = bodies[-1]
    moved = MeshTree(mesh.vertices @ pose[-1, :3, :3].T + pose[-1, :3, 3], mesh.faces)
    last = len(bodies) - 1
    for i in range(last):
        if distance(moved, bodies[i], pose_b=pose[i]).distance[0] <= 0.2:
            assert (i, last) in pairs


@settings(deadline=None, max_examples=60)
@given(
    hnp.arrays(np.float64, (40, 2, 3), elements=st.integers(-8, 8).map(float)),
    st.integers(0, 2),
    st.integers(-1, 1),
)
def test_boxes_along_the_axes_are_exact_up_to_rounding(corners, margin, exponent):
    """On a lattice: many touch, some have no thickness, some coincide; tiny, usual and huge."""
    corners = np.ldexp(corners, 300 * exponent)
    margin = float(np.ldexp(float(margin), 300 * exponent))
    low, high = corners.min(axis=1), corners.max(axis=1)
    pairs = listed(near_pairs(Hulls(corners.reshape(-1, 3), np.arange(0, 81, 2)), margin))
    gap = np.maximum(low[:, None] - high[None], low[None] - high[:, None]).max(axis=2)
    i, j = np.triu_indices(40, 1)
    inside = gap[i, j] <= margin
    assert pairs == set(zip(i[inside].tolist(), j[inside].tolist(), strict=True))


def test_moving_bodies():
    rng = np.random.default_rng(4)
    balls = Spheres(rng.uniform(-3, 3, (60, 3)), 0.2)
    move = rng.uniform(-4, 4, (60, 3))
    pairs = listed(near_pairs(balls, displacement=move))
    i, j = np.triu_indices(60, 1)
    identity = np.tile(np.eye(4), (len(i), 1, 1))
    still = np.zeros(3)
    hits = time_of_impact(
        balls[i], balls[j], Motion(identity, move[i], still), Motion(identity, move[j], still)
    ).hit
    assert set(zip(i[hits].tolist(), j[hits].tolist(), strict=True)) <= pairs
    assert 5 < hits.sum() <= len(pairs) < len(i)


@pytest.mark.parametrize("rate", [0.3, 3.0, 50.0])
def test_rotating_bodies(rate):
    rng = np.random.default_rng(5)
    n = 40
    rods = Boxes(rng.uniform(-0.5, 0.5, (n, 3)), np.tile([1.5, 0.05, 0.05], (n, 1)))
    motion = Motion(places(rng, n, 3.0), rng.normal(size=(n, 3)), rate * rng.normal(size=(n, 3)))
    pairs = listed(near_pairs(rods, motion=motion))
    i, j = np.triu_indices(n, 1)
    ends = [Motion(*(x[rows] for x in motion.packed)) for rows in (i, j)]
    hits = time_of_impact(rods[i], rods[j], *ends).hit
    assert set(zip(i[hits].tolist(), j[hits].tolist(), strict=True)) <= pairs
    assert hits.sum() > 5
    assert rate > 1 or len(pairs) < len(i)


def test_half_spaces():
    floor = HalfSpaces([[0, 0, 1], [0.6, 0, -0.8]], [0.0, -4.0])
    balls = Spheres([[0, 0, 0.5], [0, 0, 2], [9, 0, 9], [-4, 0, 0.2]], 0.4)
    assert listed(near_pairs([floor, balls])) == {(0, 5)}
    assert listed(near_pairs([balls, floor], margin=0.2)) == {(0, 4), (3, 4)}
    down = np.array([[0, 0, 0.0]] * 2 + [[0, 0, -2.0]] * 4)
    assert {(0, 2), (0, 3), (0, 5)} <= listed(near_pairs([floor, balls], displacement=down))
    lifted = np.tile(np.eye(4), (6, 1, 1))
    lifted[0, 2, 3] = 1.7
    assert {(0, 2), (0, 3)} <= listed(near_pairs([floor, balls], pose=lifted))
    spin = Motion(lifted, np.zeros(3), [0, 0, 1.0])
    with pytest.raises(ValueError, match="motion: a half-space cannot rotate"):
        near_pairs([floor, balls], motion=spin)
    slide = Motion(lifted, [0, 0, 0.5], np.zeros(3))
    assert {(0, 2), (0, 3)} <= listed(near_pairs([floor, balls], motion=slide))


def test_ten_thousand_bodies_beside_brute_force():
    rng = np.random.default_rng(6)
    center, half = rng.uniform(0, 25, (10_000, 3)), rng.uniform(0.05, 0.5, (10_000, 3))
    half[::1000] *= 20
    pairs = near_pairs(Boxes(center, half))
    assert np.array_equal(pairs, near_pairs(Boxes(center, half), threads=2))
    low, high = center - half, center + half
    assert (pairs[:, 0] < pairs[:, 1]).all()
    assert len(pairs) > 10_000
    for k in range(0, 10_000, 9):
        met = ((low[k] <= high[k + 1 :]) & (high[k] >= low[k + 1 :])).all(axis=1)
        others = pairs[slice(*np.searchsorted(pairs[:, 0], [k, k + 1])), 1]
        assert np.array_equal(others, k + 1 + np.flatnonzero(met))


def test_bad_arguments_and_empty_ones():
    balls = Spheres(np.zeros((3, 3)), 1.0)
    for nothing in ([], Spheres(np.zeros((0, 3)), 1.0), [Spheres(np.zeros((0, 3)), 1.0)]):
        assert near_pairs(nothing).shape == (0, 2)
    assert near_pairs(balls[:1]).shape == (0, 2)
    assert near_pairs(balls).tolist() == [[0, 1], [0, 2], [1, 2]]
    for margin in (-1, np.nan, np.inf, "1", [1]):
        with pytest.raises(ValueError, match="margin: "):
            near_pairs(balls, margin)
    with pytest.raises(ValueError, match=r"bodies\[1\]: .*expected"):
        near_pairs([balls, np.zeros(3)])
    with pytest.raises(ValueError, match="pose: 2 rows, expected one for each of 3 bodies"):
        near_pairs(balls, pose=np.tile(np.eye(4), (2, 1, 1)))
    with pytest.raises(ValueError, match="displacement: 2 rows, expected one for each of 3"):
        near_pairs(balls, displacement=np.zeros((2, 3)))
    rest = Motion(np.eye(4), np.zeros(3), np.zeros(3))
    with pytest.raises(ValueError, match="pose: not together with motion"):
        near_pairs(balls, motion=rest, pose=np.eye(4))
    with pytest.raises(ValueError, match=r"motion: a ndarray, expected a Motion"):
        near_pairs(balls, motion=np.eye(4))
    assert near_pairs(balls, motion=rest).shape == (3, 2)
