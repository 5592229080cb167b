"""Signed distance of two meshes beside brute force, coal and closed forms."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from oracles import coal_peer
from oracles.mesh_points import distance_of_triangles
from tauguard.rigid import MeshTree, distance
from tests.rigid.test_mesh_points import CORNERS, SIDES, ball, box, joined


def moved(offset, rotation=None):
    pose = np.eye(4)
    pose[:3, 3] = offset
    if rotation is not None:
        pose[:3, :3] = Rotation.from_rotvec(rotation).as_matrix()
    return pose


def apart_poses(n, seed, low=2.001, high=3.0):
    rng = np.random.default_rng(seed)
    pose = np.tile(np.eye(4), (n, 1, 1))
    pose[:, :3, :3] = Rotation.random(n, random_state=seed).as_matrix()
    way = rng.normal(size=(n, 3))
    length = rng.uniform(low, high, (n, 1)) / np.linalg.norm(way, axis=1, keepdims=True)
    pose[:, :3, 3] = length * way
    return pose


def check_row(a, b, pose, row, found):
    """The nearest points are on the named faces, at the distance, along the normal."""
    points = found.point_a[row], found.point_b[row]
    np.testing.assert_allclose(
        points[1] - points[0], found.distance[row] * found.normal[row], atol=1e-12
    )
    corners = b.vertices @ pose[:3, :3].T + pose[:3, 3]
    for tree, x, point, face in zip(
        (a, b), (a.vertices, corners), points, found.faces[row], strict=True
    ):
        on = MeshTree(x[tree.faces[face]], [[0, 1, 2]])
        out, index = np.empty((1, 4)), np.empty(1, dtype=np.int32)
        on._mesh.nearest(np.ascontiguousarray(point[None]), out, index, 1)
        assert out[0, 0] < 1e-12


@pytest.mark.parametrize("volume", MeshTree.volumes)
def test_small_meshes_beside_brute_force(volume):
    """Triangles at random, with degenerate ones and slivers, and on a lattice: often parallel."""
    for seed in range(12):
        rng = np.random.default_rng(seed)
        vertices = [rng.normal(size=(12, 3)), rng.integers(-2, 3, (12, 3)).astype(float)][seed % 2]
        vertices[3] = vertices[4] if seed % 3 == 0 else vertices[4] + 1e-9
        faces = rng.permutation(12).reshape(4, 3)
        a, b = (MeshTree(x, faces, volume) for x in (vertices, vertices[::-1]))
        poses = np.array([moved(x) for x in rng.integers(-6, 7, (4, 3))])
        found = distance(a, b, pose_b=poses)
        for row, pose in enumerate(poses):
            shifted = b.vertices[faces] + pose[:3, 3]
            met = a.overlap(b, pose).hit[0]
            assert (found.distance[row] == 0) == met
            if not met:
                truth = min(distance_of_triangles(x, y) for x in vertices[faces] for y in shifted)
                assert found.distance[row] == pytest.approx(truth, abs=1e-12)
                check_row(a, b, pose, row, found)


@pytest.mark.parametrize("volume", MeshTree.volumes)
def test_spheres_beside_coal(volume):
    coal = coal_peer.coal_module()
    a, poses = ball(3, volume), apart_poses(40, 0)
    found = distance(a, a, pose_b=poses)
    peer, _ = coal_peer.mesh(a.vertices, a.faces)
    for row, pose in enumerate(poses):
        place = coal.Transform3s(pose[:3, :3].copy(), pose[:3, 3].copy())
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        theirs = coal.distance(peer, coal.Transform3s.Identity(), peer, place, request, result)
        assert found.distance[row] == pytest.approx(theirs, abs=1e-12)
        check_row(a, a, pose, row, found)


def test_poses_of_both_sides():
    a, b, poses = ball(1), box([-0.3, -0.2, -0.1], [0.3, 0.4, 0.5]), apart_poses(20, 1)
    world = apart_poses(20, 2)
    here, there = distance(a, b, pose_b=poses), distance(a, b, pose_a=world, pose_b=world @ poses)
    np.testing.assert_allclose(there.distance, here.distance, atol=1e-13)
    turned = np.einsum("nij,nj->ni", world[:, :3, :3], here.normal)
    np.testing.assert_allclose(there.normal, turned, atol=1e-9)
    placed = np.einsum("nij,nj->ni", world[:, :3, :3], here.point_b) + world[:, :3, 3]
    np.testing.assert_allclose(there.point_b, placed, atol=1e-9)
    one = distance(a, b, pose_a=world[0], pose_b=poses)
    assert one.distance.shape == (20,)
    swapped = distance(b, a, pose_a=poses)
    np.testing.assert_allclose(swapped.distance, here.distance, atol=1e-13)
    np.testing.assert_allclose(swapped.normal, -here.normal, atol=1e-9)


def test_an_l_shape_is_not_its_hull():
    angle = joined(box([0, 0, 0], [3, 1, 1]), box([0, 1, 0], [1, 3, 1]))
    found = distance(angle, box([1.3, 1.3, 0.2], [1.6, 1.6, 0.5]))
    assert found.distance[0] == pytest.approx(0.3, abs=1e-15)
    assert found.normal[0] @ [1, 1, 0] == pytest.approx(1)  # from either of the two arms


OVERLAPS = [
    ([0.7, 0.6, 0.8], -0.2),
    ([1, 0, 0], 0),  # faces that touch
    ([1, 1, 0], 0),
    ([1, 1, 1], 0),
    ([1.5, 0, 0], 0.5),
]


@pytest.mark.parametrize("offset", [[0.5, 0, 0], [0, 0, 0], [0, 0.75, 0], [0.25, 0.25, 0]])
def test_boxes_with_flush_sides_overlap(offset):
    """No corner is inside of the other box. The depth is between 0 and the translation."""
    a = box([0, 0, 0], [1, 1, 1])
    found = distance(a, a, pose_b=moved(offset))
    assert -(1 - max(offset)) <= found.distance[0] <= -0.1 * (1 - max(offset))


@pytest.mark.parametrize(("offset", "wanted"), OVERLAPS)
@pytest.mark.parametrize("far", [0.0, 1000.0])
def test_boxes(offset, wanted, far):
    a = MeshTree(CORNERS + far, SIDES)
    found = distance(a, a, pose_b=moved(offset))
    assert found.distance[0] == pytest.approx(wanted, abs=1e-12 * max(far, 1))
    assert np.linalg.norm(found.normal[0]) == pytest.approx(1)
    gap = found.point_b - found.point_a
    assert gap[0] @ found.normal[0] == pytest.approx(wanted, abs=1e-12 * max(far, 1))


def test_one_in_the_other():
    outer, inner = box([0, 0, 0], [4, 4, 4]), box([1, 1, 1], [2, 2, 2])
    for a, b, sign in ((outer, inner, 1), (inner, outer, -1)):
        found = distance(a, b)
        assert found.distance[0] == -2  # the corner (2, 2, 2)
        assert found.faces.tolist() == [[-1, -1]]
        way = sign * (found.point_a - found.point_b)[0] / 2
        np.testing.assert_allclose(np.sort(np.abs(way)), [0, 0, 1])
    hollow = joined(outer, MeshTree(box([0.5] * 3, [3.5] * 3).vertices, SIDES[:, ::-1]))
    assert distance(hollow, inner).distance[0] == 0.5
    assert distance(MeshTree(outer.vertices, SIDES[1:]), inner).distance[0] == 1  # open: no inside


def test_bars_that_cross_without_a_corner_inside():
    a, b = box([-5, -0.5, -0.5], [5, 0.5, 0.5]), box([-0.5, -5, -0.25], [0.5, 5, 0.75])
    found = distance(a, b)
    assert -1 <= found.distance[0] <= -0.1
    apart = distance(a, b, pose_b=moved(-found.distance[0] * found.normal[0] * 4))
    assert apart.distance[0] > 0


def test_depths_of_spheres_are_lower_bounds_that_separate_nearly():
    a, poses = ball(3), apart_poses(30, 3, 0.3, 1.9)
    found = distance(a, a, pose_b=poses)
    depth = 2 - np.linalg.norm(poses[:, :3, 3], axis=1)
    assert (-found.distance <= depth + 1e-12).all()
    shallow = depth < 0.6  # deeper, a corner is nearer to another side
    assert (-found.distance >= 0.95 * depth - 0.02)[shallow].all()
    assert (found.distance < 0).all()
    assert shallow.sum() > 5


@pytest.mark.parametrize("scale", [1e-38, 1e-20, 1e20, 1e29])
def test_tiny_and_huge_meshes(scale):
    a, poses = ball(1), apart_poses(10, 4)
    scaled, there = MeshTree(scale * a.vertices, a.faces), poses.copy()
    there[:, :3, 3] *= scale
    found = distance(scaled, scaled, pose_b=there).distance
    np.testing.assert_allclose(found / scale, distance(a, a, pose_b=poses).distance, rtol=1e-12)


def test_open_meshes_that_intersect_have_distance_0():
    flat = MeshTree([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    found = distance(flat, flat, pose_b=moved([0, 0, 0], [np.pi / 2, 0, 0]))
    assert found.distance[0] == 0
    np.testing.assert_array_equal(found.point_a, found.point_b)
    assert found.faces.tolist() == [[0, 0]]


def test_bad_arguments():
    a = ball(1)
    with pytest.raises(ValueError, match="other: its volume is 'aabb', this tree's 'obb'"):
        distance(a, ball(1, "aabb"))
    with pytest.raises(ValueError, match=r"pose_b: .*row 1"):
        distance(a, a, pose_b=np.stack([np.eye(4), 2 * np.eye(4)]))
    with pytest.raises(ValueError, match="pose_a: 2 rows, expected 3 or 1"):
        distance(a, a, pose_a=apart_poses(2, 0), pose_b=apart_poses(3, 0))
    with pytest.raises(ValueError, match="the meshes are more than 1e30 apart in row 1; scale"):
        distance(a, a, pose_b=np.stack([np.eye(4), moved([1e31, 0, 0])]))
    assert distance(a, a, pose_b=moved([1e29, 0, 0])).distance[0] == pytest.approx(1e29)
    assert distance(a, a, pose_b=np.zeros((0, 4, 4))).distance.shape == (0,)
