"""Options at the start of a motion, and rotations of subnormal angle."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from oracles.curved_bodies import Sets
from tauguard.rigid import (
    Boxes,
    Capsules,
    Cylinders,
    MeshTree,
    Motion,
    Spheres,
    distance,
    time_of_impact,
)

CUBE = Boxes([[0, 0, 0]], [[1, 1, 1]])
REST = Motion(np.eye(4), [0, 0, 0], [0, 0, 0])


def moving(x, linear, angular=(0, 0, 0)):
    pose = np.eye(4)
    pose[:3, 3] = x
    return Motion(pose, linear, angular)


@pytest.mark.parametrize("top", [CUBE, Cylinders([[0, 0, 0]], 1, 1), Spheres([[0, 0, 0]], 1)])
def test_normal_and_depth_of_bodies_that_overlap(top):
    away = moving([0, 0, 1.75], [0, 0, 2])
    plain = time_of_impact(CUBE, top, REST, away)
    assert plain.hit[0]
    assert plain.depth is None
    assert np.isnan(plain.normal).all()
    got = time_of_impact(CUBE, top, REST, away, compute_impact_geometry_on_penetration=True)
    np.testing.assert_allclose(got.normal, [[0, 0, 1]], atol=1e-9)
    np.testing.assert_allclose(got.depth, [0.25], atol=1e-9)
    assert got.time_of_impact[0] == 0
    far = time_of_impact(CUBE, top, REST, moving([0, 0, 5], [0, 0, -6]),
                         compute_impact_geometry_on_penetration=True)  # fmt: skip
    assert far.depth[0] == 0
    assert far.time_of_impact[0] == pytest.approx(0.5, abs=1e-6)


@pytest.mark.parametrize("top", [CUBE, Cylinders([[0, 0, 0]], 1, 1)])
def test_bodies_that_separate_are_no_hit(top):
    def ask(motion):
        return time_of_impact(CUBE, top, REST, motion, stop_at_penetration=False)

    assert not ask(moving([0, 0, 1.75], [0, 0, 2])).hit[0]
    assert not ask(moving([0, 0, 1.75], [0.1, 0, 0])).hit[0]  # at rest along the normal
    into = ask(moving([0, 0, 1.75], [0, 0, -2]))
    assert into.hit[0]
    assert into.time_of_impact[0] == 0
    # Both at once: one pair parts, one approaches, one meets later.
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, 2, 3] = [1.75, 1.75, 4]
    both = ask(Motion(poses, [[0, 0, 2], [0, 0, -2], [0, 0, -4]], np.zeros((3, 3))))
    np.testing.assert_array_equal(both.hit, [False, True, True])
    np.testing.assert_allclose(both.time_of_impact, [np.inf, 0, 0.5], atol=1e-6)


def test_a_bar_that_parts_and_comes_round_again():
    bar = Boxes([[2, 0, 0]], [[1.5, 0.1, 0.1]])  # turns about the origin once in the step
    post = Boxes([[2, -0.15, 0]], [[0.1, 0.1, 5]])
    turn = Motion(np.eye(4), [0, 0, 0], [0, 0, 2 * np.pi])
    assert time_of_impact(post, bar, REST, turn).time_of_impact[0] == 0
    got = time_of_impact(post, bar, REST, turn, stop_at_penetration=False)
    t = np.linspace(0.5, 1, 20001)
    poses = np.tile(np.eye(4), (len(t), 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(t[:, None] * [0, 0, 2 * np.pi]).as_matrix()
    first = t[distance(post, bar, pose_b=poses).distance <= 0][0]
    assert first - 1e-4 <= got.time_of_impact[0] <= first


@pytest.mark.parametrize("kinds", [("boxes", "hulls"), ("cones", "ellipsoids"), ("boxes", "cones")])
def test_target_distances(kinds):
    rng = np.random.default_rng(5)
    n, target = 200, 0.3
    a, b = (Sets(kind, rng, n, 2).bodies() for kind in kinds)
    still = Motion(np.tile(np.eye(4), (n, 1, 1)), [0, 0, 0], [0, 0, 0])
    motion = Motion(still.pose_t0, rng.uniform(-2, 2, (n, 3)), rng.uniform(-1, 1, (n, 3)))
    got = time_of_impact(a, b, still, motion, target_distance=target)
    assert 20 < got.hit.sum() < 190
    t = np.where(got.hit, got.time_of_impact, 1)
    reached = distance(a, b, pose_b=motion.at(t)).distance
    later = got.hit & (got.time_of_impact > 0)
    np.testing.assert_allclose(reached[later], target, atol=1e-6)
    assert (reached[~got.hit] >= target - 1e-6).all()
    for s in np.linspace(0, 1, 9):
        before = got.hit & (s < got.time_of_impact)
        assert (distance(a, b, pose_b=motion.at(s)).distance[before] >= target - 1e-9).all()


def test_target_distance_of_a_mesh():
    floor = MeshTree([[-9, -9, 0], [9, -9, 0], [0, 9, 0.0]], [[0, 1, 2]])
    rod = Capsules([[0, 0, 0]], [[1, 0, 0]], 0.25)
    fall = moving([0, 0, 2], [0, 0, -2])
    got = time_of_impact(floor, rod, REST, fall, target_distance=0.5)
    assert got.time_of_impact[0] == pytest.approx(0.625, abs=1e-9)
    with pytest.raises(ValueError, match="target_distance: two meshes"):
        time_of_impact(floor, floor, REST, fall, target_distance=0.5)
    with pytest.raises(ValueError, match="a: MeshTree, expected convex bodies with"):
        time_of_impact(floor, rod, REST, fall, stop_at_penetration=False)
    with pytest.raises(ValueError, match="target_distance: -1, expected"):
        time_of_impact(CUBE, CUBE, REST, fall, target_distance=-1)


@pytest.mark.parametrize("rate", [1e-290, 1e-300, 1e-308, 1e-310, 1e-320, 5e-324])
@pytest.mark.parametrize("kind", ["boxes", "hulls", "cylinders", "cones", "capsules"])
def test_subnormal_rotations(rate, kind):
    body = Sets(kind, np.random.default_rng(2), 1, 0).bodies()
    for axis in np.eye(3):
        spin = rate * axis
        away = time_of_impact(body, body, REST, moving([50, 0, 0], [0, 0, 0], spin))
        assert not away.hit[0]
        still = time_of_impact(body, body, REST, moving([50, 0, 0], [-60, 0, 0]))
        got = time_of_impact(body, body, REST, moving([50, 0, 0], [-60, 0, 0], spin))
        assert got.time_of_impact[0] == pytest.approx(still.time_of_impact[0], abs=1e-9)


def test_extreme_translations():
    for far in (1e-300, 1e-150, 1e99):
        for kind in ("boxes", "cylinders"):
            body = Sets(kind, np.random.default_rng(2), 1, 0).bodies()
            motion = moving([5, 0, 0], [far, -far, far], [0, min(far, 1), 0])
            got = time_of_impact(body, body, REST, motion)
            assert not got.hit[0]
