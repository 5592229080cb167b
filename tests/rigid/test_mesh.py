"""Mesh overlap and contacts against all pairs, exact rationals, coal and analytic cases."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from oracles.triangle_meshes import cube, icosphere, random_poses, soup, transform, triangles_meet
from tauguard.rigid import MeshTree, Motion, _rigid
from tauguard.rigid.comparators import ComparedTree

VOLUMES = ["aabb", "obb", "k_dop", "sphere"]


def native(pairs):
    out = np.empty(len(pairs), dtype=bool)
    _rigid.triangles_overlap(np.ascontiguousarray(pairs, dtype=float), out)
    return out


def all_pairs(v, f, w, g, pose):
    """Every pair of faces that meet, by testing them all."""
    a, b = v[f], transform(pose, w)[g]
    i, j = (x.ravel() for x in np.indices((len(a), len(b))))
    hit = native(np.stack([a[i], b[j]], axis=1))
    return set(zip(i[hit], j[hit], strict=True))


small = st.integers(-2, 2).map(float)
triangle = st.lists(st.tuples(small, small, small), min_size=3, max_size=3)


@settings(max_examples=80, deadline=None)
@given(triangle, triangle)
def test_triangles_on_a_grid_are_answered_exactly(a, b):
    assert native([[a, b]])[0] == triangles_meet(a, b)


def test_triangles_a_rounding_away_from_touching():
    rng = np.random.default_rng(3)
    for offset, scale in [(0, 1.0), (1e6, 1.0), (0, 1e-200), (0, 1e90)]:
        a = rng.integers(-3, 4, (60, 3, 3)).astype(float)
        b = rng.integers(-3, 4, (60, 3, 3)).astype(float)
        weight = rng.dirichlet(np.ones(3), 60)
        b[:, 0] = np.einsum("ni,nij->nj", weight, a)  # a corner on the other triangle, rounded
        pairs = np.stack([a, b], axis=1) * scale + offset
        expected = [triangles_meet(*p) for p in pairs]
        np.testing.assert_array_equal(native(pairs), expected)
        np.testing.assert_array_equal(native(pairs[:, ::-1]), expected)


@pytest.mark.parametrize("volume", VOLUMES)
@pytest.mark.parametrize("n", [1, 2, 3, 17, 60])
def test_every_pair_and_no_other(volume, n):
    rng = np.random.default_rng(n)
    v, f = soup(rng, n)
    w, g = soup(rng, 40)
    poses = random_poses(rng, 25, 1.0)
    poses[0, :3, :3] = np.eye(3)
    a, b = ComparedTree(v, f, volume), ComparedTree(w, g, volume)
    overlap, contacts = a.overlap(b, poses), a.contacts(b, poses)
    for i, pose in enumerate(poses):
        truth = all_pairs(v, f, w, g, pose)
        listed = contacts.faces[contacts.pose == i]
        assert {tuple(x) for x in listed} == truth
        assert len(listed) == len(truth)
        assert overlap.hit[i] == bool(truth)
        if truth:
            assert tuple(overlap.faces[i]) in truth
        else:
            assert tuple(overlap.faces[i]) == (-1, -1)


@pytest.mark.parametrize("volume", VOLUMES)
@pytest.mark.parametrize("scale", [1e-200, 1e-42, 1e24])
@pytest.mark.parametrize("stretch", [(1, 1, 1e-7), (1, 1, 0), (1e5, 1, 1)])
def test_every_pair_at_any_scale_and_however_flat(volume, scale, stretch):
    rng = np.random.default_rng(4)
    v, f = soup(rng, 20)
    v *= scale * np.array(stretch)
    poses = random_poses(rng, 5, 0.5 * scale)
    poses[:2, :3, :3] = np.eye(3)
    poses[:2, 2, 3] = 0
    tree = ComparedTree(v, f, volume)
    contacts = tree.contacts(tree, poses)
    for i, pose in enumerate(poses):
        assert {tuple(x) for x in contacts.faces[contacts.pose == i]} == all_pairs(v, f, v, f, pose)
    assert len(contacts) > 0


@pytest.mark.parametrize("volume", VOLUMES)
@pytest.mark.parametrize("shift", [0.0, 1e6, -1e9])
def test_cubes_that_just_touch(volume, shift):
    v, f = cube()
    a = ComparedTree(v + shift, f, volume)
    pose = np.tile(np.eye(4), (6, 1, 1))
    step = np.spacing(abs(shift) + 1) * 2
    pose[:, 0, 3] = [1, 1 + step, -1, -1 - step, 1, 1]
    pose[:, 1, 3] = [0, 0, 0, 0, 1, 1 + step]
    assert a.overlap(a, pose).hit.tolist() == [True, False, True, False, True, False]


def test_a_mesh_inside_another_has_no_common_surface():
    v, f = cube()
    assert not MeshTree(v, f).overlap(MeshTree(0.5 * v, f), np.eye(4)).hit[0]


def test_spheres_meet_as_their_distance_says():
    v, f = icosphere(3)
    tree = MeshTree(v, f)
    rng = np.random.default_rng(0)
    poses = random_poses(rng, 400, 0.0)
    direction = rng.normal(size=(400, 3))
    distance = rng.uniform(1.8, 2.2, 400)
    poses[:, :3, 3] = direction / np.linalg.norm(direction, axis=1)[:, None] * distance[:, None]
    hit = tree.overlap(tree, poses).hit
    thickness = 1 - np.linalg.norm(v[f].mean(axis=1), axis=1).min()
    assert not hit[distance > 2].any()
    assert hit[distance < 2 - 2 * thickness].all()


def coal_model(coal, v, f):
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(f), len(v))
    points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for p in v:
        points.append(p)
    for t in f:
        triangles.append(coal.Triangle(*map(int, t)))
    model.addSubModel(points, triangles)
    model.endModel()
    return model


def test_coal_agrees():
    coal = pytest.importorskip("coal")
    rng = np.random.default_rng(8)
    v, f = icosphere(2)
    v = v * [1.0, 0.6, 0.3] + 0.02 * rng.normal(size=v.shape)
    poses = random_poses(rng, 500, 1.6)
    hit = MeshTree(v, f).overlap(MeshTree(v, f), poses).hit
    model, here = coal_model(coal, v, f), coal.Transform3s()
    for pose, ours in zip(poses, hit, strict=True):
        there = coal.Transform3s(pose[:3, :3], pose[:3, 3])
        result = coal.CollisionResult()
        coal.collide(model, here, model, there, coal.CollisionRequest(), result)
        assert result.isCollision() == ours
    assert 0.2 < hit.mean() < 0.8


def test_contacts_of_a_cube_dipped_into_another():
    v, f = cube()
    a, b = MeshTree(v, f), MeshTree(0.5 * v, f)
    pose = np.eye(4)
    pose[2, 3] = 0.5 + 0.25 - 0.1  # the small cube stands 0.1 deep in the top face
    c = a.contacts(b, pose)
    top = np.abs(c.normal[:, 2]) > 0.999
    assert len(c) > 0
    assert top.any()
    np.testing.assert_allclose(c.normal[top, 2], 1.0)
    np.testing.assert_allclose(c.penetration[top], 0.1, atol=1e-12)
    np.testing.assert_allclose(c.point[:, 2], 0.5, atol=1e-12)
    assert (np.abs(c.point[:, :2]) <= 0.25 + 1e-12).all()


def test_contacts_are_the_same_seen_from_either_side_and_from_anywhere():
    rng = np.random.default_rng(5)
    v, f = icosphere(2)
    w, g = soup(rng, 60)
    a, b = MeshTree(v, f), MeshTree(w, g)
    pose = random_poses(rng, 1, 0.4)[0]
    c = a.contacts(b, pose)
    assert len(c) > 20
    back = b.contacts(a, np.linalg.inv(pose))
    order = np.lexsort((back.faces[:, 0], back.faces[:, 1]))
    np.testing.assert_array_equal(back.faces[order][:, ::-1], c.faces)
    r = pose[:3, :3]
    np.testing.assert_allclose(back.point[order] @ r.T + pose[:3, 3], c.point, atol=1e-12)
    np.testing.assert_allclose(back.penetration[order], c.penetration, atol=1e-12)
    np.testing.assert_allclose(back.normal[order] @ r.T, -c.normal, atol=1e-9)
    # Both meshes moved together by `world`.
    world = random_poses(rng, 1, 5.0)[0]
    moved = MeshTree(transform(world, v), f).contacts(b, world @ pose)
    np.testing.assert_array_equal(moved.faces, c.faces)
    np.testing.assert_allclose(moved.point, transform(world, c.point), atol=1e-11)
    np.testing.assert_allclose(moved.normal, c.normal @ world[:3, :3].T, atol=1e-9)
    np.testing.assert_allclose(moved.penetration, c.penetration, atol=1e-11)


def test_a_contact_comes_free_along_its_normal():
    rng = np.random.default_rng(6)
    a, b = (rng.uniform(-1, 1, (40, 3, 3)) for _ in range(2))
    faces = np.array([[0, 1, 2]])
    seen = 0
    for x, y in zip(a, b, strict=True):
        c = MeshTree(x, faces).contacts(MeshTree(y, faces), np.eye(4))
        if len(c) == 0:
            continue
        seen += 1
        np.testing.assert_allclose(np.linalg.norm(c.normal), 1.0)
        out = (c.penetration[0] + 1e-9) * c.normal[0]
        inside = (c.penetration[0] - 1e-6) * c.normal[0]
        assert not triangles_meet(x, y + out)
        assert c.penetration[0] < 1e-6 or triangles_meet(x, y + inside)
    assert seen > 5


@pytest.mark.parametrize("volume", VOLUMES)
def test_thread_count_changes_nothing(volume):
    rng = np.random.default_rng(4)
    v, f = soup(rng, 300)
    tree = ComparedTree(v, f, volume)
    poses = random_poses(rng, 64, 1.5)
    faces = [tree.overlap(tree, poses, threads=n).faces for n in (1, 2, 5)]
    contacts = [tree.contacts(tree, poses, threads=n) for n in (1, 2, 5)]
    for n in (1, 2):
        np.testing.assert_array_equal(faces[n], faces[0])
        for name in ("pose", "faces", "point", "normal", "penetration"):
            ours, first = (getattr(c, name) for c in (contacts[n], contacts[0]))
            assert ours.tobytes() == first.tobytes()


def test_rotation_only_orthonormal_to_1e_6_still_misses_nothing():
    rng = np.random.default_rng(7)
    v, f = soup(rng, 40)
    poses = random_poses(rng, 40, 0.8)
    poses[:, :3, :3] += rng.uniform(-2e-7, 2e-7, (40, 3, 3))
    for volume in VOLUMES:
        tree = ComparedTree(v, f, volume)
        hit = tree.overlap(tree, poses).hit
        assert hit.tolist() == [bool(all_pairs(v, f, v, f, p)) for p in poses]


def test_bad_meshes_are_refused():
    v, f = cube()
    with pytest.raises(ValueError, match="vertices: nan in row 3"):
        MeshTree(np.where(np.arange(24).reshape(8, 3) == 10, np.nan, v), f)
    with pytest.raises(ValueError, match="faces: index 8 in row 2, expected 0 to 7"):
        MeshTree(v, np.where(np.arange(36).reshape(12, 3) == 7, 8, f))
    with pytest.raises(ValueError, match="faces: empty"):
        MeshTree(v, np.zeros((0, 3), dtype=int))
    with pytest.raises(ValueError, match="volume: 'ellipsoid', expected one of obb"):
        MeshTree(v, f, "ellipsoid")
    with pytest.raises(ValueError, match="other: its volume is 'aabb'"):
        MeshTree(v, f).overlap(MeshTree(v, f, "aabb"), np.eye(4))


def test_bad_poses_are_refused():
    v, f = cube()
    tree = MeshTree(v, f)
    poses = np.tile(np.eye(4), (5, 1, 1))
    with pytest.raises(ValueError, match=r"pose: shape \(3, 3\)|pose: shape \(1, 3, 3\)"):
        tree.overlap(tree, np.eye(3))
    bad = poses.copy()
    bad[3, 1, 1] = np.inf
    with pytest.raises(ValueError, match="pose: inf in row 3"):
        tree.contacts(tree, bad)
    bad = poses.copy()
    bad[2, 0, 0] = 1.001
    with pytest.raises(ValueError, match="pose: the rotation in row 2"):
        tree.overlap(tree, bad)
    bad = poses.copy()
    bad[4, 0, 0] = -1
    with pytest.raises(ValueError, match="pose: the rotation in row 4"):
        tree.overlap(tree, bad)
    bad = poses.copy()
    bad[1, 3] = [0, 0, 1, 1]
    with pytest.raises(ValueError, match=r"pose: bottom row .* in row 1"):
        tree.overlap(tree, bad)
    assert tree.overlap(tree, np.zeros((0, 4, 4))).hit.shape == (0,)


def test_motion_follows_its_definition():
    rng = np.random.default_rng(9)
    poses = random_poses(rng, 10, 2.0)
    linear, angular = rng.normal(size=(2, 10, 3))
    motion = Motion(poses, linear, angular)
    t = rng.uniform(0, 1, 10)
    turn = Rotation.from_rotvec(t[:, None] * angular).as_matrix()
    np.testing.assert_allclose(motion.at(t)[:, :3, :3], turn @ poses[:, :3, :3], atol=1e-14)
    np.testing.assert_allclose(motion.at(t)[:, :3, 3], poses[:, :3, 3] + t[:, None] * linear)
    np.testing.assert_array_equal(motion.at(0.0), poses)
    with pytest.raises(ValueError, match="angular: shape"):
        Motion(poses, linear, angular[:3])
    with pytest.raises(ValueError, match="linear: nan in row 0"):
        Motion(np.eye(4), [np.nan, 0, 0], [0, 0, 0])
