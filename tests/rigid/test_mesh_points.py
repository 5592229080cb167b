"""Containment, signed distance, ray casts and self-contacts beside exact brute force."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.spatial.transform import Rotation

from oracles.mesh_points import meets_at, solid_angle_winding, square_distance
from oracles.triangle_meshes import icosphere, triangles_meet
from tauguard.rigid import MeshTree, Spheres, distance

CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
SIDES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
     [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)  # fmt: skip
lattice = hnp.arrays(np.float64, (6, 3), elements=st.integers(-6, 6).map(lambda k: k / 2))


def box(low, high, volume="obb"):
    low, high = np.array(low, dtype=float), np.array(high, dtype=float)
    return MeshTree(low + CORNERS * (high - low), SIDES, volume)


def joined(*trees):
    starts = np.cumsum([0, *(len(t.vertices) for t in trees[:-1])])
    return MeshTree(
        np.concatenate([t.vertices for t in trees]),
        np.concatenate([t.faces + s for t, s in zip(trees, starts, strict=True)]),
    )


def ball(level=2, volume="obb", seed=0):
    vertices, faces = icosphere(level)
    turned = Rotation.random(random_state=seed).apply(np.asarray(vertices, dtype=float))
    return MeshTree(turned, faces, volume)


@pytest.mark.parametrize("volume", MeshTree.volumes)
def test_points_of_a_lattice_are_in_the_box_or_not(volume):
    """Many are on faces, edges and corners, or straight below edges and corners."""
    points = np.array(np.meshgrid(*[np.arange(-2, 6) / 2.0] * 3)).reshape(3, -1).T
    tree = box([0, 0, 0], [1, 1, 1], volume)
    inside = ((points >= 0) & (points <= 1)).all(axis=1)
    assert np.array_equal(tree.contains(points), inside)
    gap = np.maximum(np.maximum(-points, points - 1), 0)
    deep = np.minimum(points, 1 - points).min(axis=1)
    wanted = np.where(inside, -deep, np.linalg.norm(gap, axis=1))
    np.testing.assert_allclose(tree.signed_distance(points).distance, wanted, atol=1e-15)


def test_parts_may_intersect_lie_apart_or_be_a_cavity():
    """A box with a cavity, in which a smaller box floats, and a box that intersects its wall."""
    outer, inner = box([0, 0, 0], [10, 10, 10]), box([2, 2, 2], [8, 8, 8])
    cavity = MeshTree(inner.vertices, inner.faces[:, ::-1])
    tree = joined(outer, cavity, box([4, 4, 4], [6, 6, 6]), box([9, 9, 9], [12, 12, 12]))
    points = np.array([[1, 5, 5], [3, 5, 5], [5, 5, 5], [9.5, 9.5, 9.5], [11, 11, 11], [11, 5, 5]])
    assert tree.contains(points).tolist() == [True, False, True, True, True, False]
    assert np.sign(tree.signed_distance(points).distance).tolist() == [-1, 1, -1, -1, -1, 1]


def test_separate_triangles_are_closed_and_degenerate_ones_do_not_matter():
    tree = box([0, 0, 0], [1, 1, 1])
    loose = MeshTree(tree.vertices[tree.faces].reshape(-1, 3), np.arange(36).reshape(12, 3))
    assert loose.closed
    assert loose.contains([[0.5, 0.5, 0.5]]).all()
    more = MeshTree(tree.vertices, np.concatenate([tree.faces, [[0, 0, 1], [3, 3, 3]]]))
    assert more.closed
    assert len(loose.self_contacts()) == len(more.self_contacts()) == 0


@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e12])
def test_random_points_have_the_winding_of_solid_angles(scale):
    rng = np.random.default_rng(1)
    tree = ball()
    points = rng.uniform(-1.1, 1.1, (2000, 3))
    turns = solid_angle_winding(points, tree.vertices[tree.faces])
    moved = MeshTree(scale * (tree.vertices + 3), tree.faces)
    assert np.array_equal(moved.contains(scale * (points + 3)), turns > 0.5)


@settings(deadline=None, max_examples=40)
@given(lattice, lattice)
def test_nearest_points_are_those_of_fractions(vertices, points):
    """Faces at random, some of them without area: an open mesh, as seen by points."""
    faces = np.array(list(combinations(range(6), 3))[::3])
    tree = MeshTree(vertices, faces)
    out, face = np.empty((6, 4)), np.empty(6, dtype=np.int32)
    tree._mesh.nearest(points, out, face, 1)
    for k, point in enumerate(points):
        squares = [square_distance(point, vertices[f]) for f in faces]
        assert abs(out[k, 0] - float(min(squares)) ** 0.5) <= 1e-12 * 10
        assert float(squares[face[k]]) ** 0.5 <= float(min(squares)) ** 0.5 + 1e-11
        np.testing.assert_allclose(np.linalg.norm(point - out[k, 1:]), out[k, 0], atol=1e-15)


def test_nearest_points_of_slivers():
    rng = np.random.default_rng(2)
    corners = rng.normal(size=(200, 3, 3))
    corners[:, 2] = corners[:, :2].mean(axis=1)
    corners[:, 2] += 10.0 ** rng.uniform(-16, -1, (200, 1)) * rng.normal(size=(200, 3))
    points = rng.normal(size=(200, 3))
    points[::2] = np.einsum("nk,nkj->nj", rng.dirichlet([1, 1, 1], 100), corners[::2])
    for triangle, point in zip(corners, points, strict=True):
        tree = MeshTree(triangle, [[0, 1, 2]])
        out, face = np.empty((1, 4)), np.empty(1, dtype=np.int32)
        tree._mesh.nearest(point[None], out, face, 1)
        assert abs(out[0, 0] - float(square_distance(point, triangle)) ** 0.5) <= 1e-12


def test_signed_distances_agree_with_spheres_of_radius_0():
    rng = np.random.default_rng(3)
    tree, points = ball(), rng.uniform(-1.5, 1.5, (300, 3))
    ours = tree.signed_distance(points)
    other = distance(tree, Spheres(points, 0.0))
    np.testing.assert_allclose(ours.distance, other.distance, atol=1e-13)
    assert (np.sign(ours.distance) == np.where(tree.contains(points), -1, 1)).all()


@settings(deadline=None, max_examples=60)
@given(lattice, lattice, lattice)
def test_rays_hit_what_fractions_say(vertices, origins, directions):
    faces = np.array(list(combinations(range(6), 3))[::4])
    directions = np.where(directions.any(axis=1)[:, None], directions, [1.0, 0, 0])
    for volume in MeshTree.volumes:
        hits = MeshTree(vertices, faces, volume).cast(origins, directions)
        for k in range(6):
            at = [meets_at(origins[k], directions[k], vertices[f]) for f in faces]
            times = [t for t in at if t is not None]
            assert hits.hit[k] == bool(times)
            if times:
                length = np.linalg.norm(directions[k])
                assert hits.distance[k] == pytest.approx(float(min(times)) * length, abs=1e-12)
                assert at[hits.face[k]] is not None


def test_no_ray_passes_between_faces():
    """Rays from inside through corners, edges and random points of a closed mesh."""
    rng = np.random.default_rng(4)
    tree = ball(3)
    corners = tree.vertices[tree.faces]
    targets = np.concatenate([tree.vertices, corners.mean(axis=1), corners[:, :2].mean(axis=1)])
    origins = 0.3 * rng.uniform(-1, 1, targets.shape)
    hits = tree.cast(origins, targets - origins)
    assert hits.hit.all()
    reach = np.linalg.norm(targets - origins, axis=1)
    np.testing.assert_allclose(hits.distance, reach, rtol=1e-9)
    assert (np.einsum("ij,ij->i", hits.normal, targets - origins) > 0).all()
    assert not tree.cast(3 * targets, targets).hit.any()
    far = tree.cast(1e6 * targets, -targets)
    assert far.hit.all()


def test_rays_broadcast_and_start_on_faces():
    tree = box([0, 0, 0], [1, 1, 1])
    down = tree.cast([[0.5, 0.25, 3], [0.25, 0.5, 1], [5, 5, 5]], [0, 0, -2])
    assert down.distance.tolist() == [2, 0, np.inf]
    assert down.hit.tolist() == [True, True, False]
    assert down.face[2] == -1
    np.testing.assert_array_equal(down.normal[:2], [[0, 0, 1], [0, 0, 1]])
    assert np.isnan(down.normal[2]).all()
    assert tree.cast([0.5, 0.25, 0.5], np.eye(3)).distance.tolist() == [0.5, 0.75, 0.5]


def brute_self_contacts(tree):
    """Pairs without a common corner that meet, in fractions."""
    corners = tree.vertices[tree.faces]
    return [
        [i, j]
        for i, j in combinations(range(len(tree)), 2)
        if not set(tree.faces[i]) & set(tree.faces[j]) and triangles_meet(corners[i], corners[j])
    ]


@pytest.mark.parametrize("volume", MeshTree.volumes)
def test_self_contacts_are_those_of_brute_force(volume):
    for seed in range(3):
        rng = np.random.default_rng(seed)
        vertices = rng.integers(-3, 4, (12, 3)).astype(float)
        faces = rng.permutation(12).reshape(4, 3)
        tree = MeshTree(vertices, faces, volume)
        assert tree.self_contacts().faces.tolist() == brute_self_contacts(tree)
    assert len(ball(2, volume).self_contacts()) == 0


def test_faces_that_share_a_corner_or_an_edge_can_meet_elsewhere():
    flat = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0.25, 0.25, 0], [1, 1, 1.0]])
    folded = MeshTree(flat, [[0, 1, 2], [0, 1, 4]])  # on one side of the common edge
    assert folded.self_contacts().faces.tolist() == [[0, 1]]
    assert len(MeshTree(flat, [[0, 1, 2], [1, 2, 3]]).self_contacts()) == 0
    pierced = np.concatenate([flat, [[0.5, 0.25, -1], [0.25, 0.5, 1]]])
    assert len(MeshTree(pierced, [[0, 1, 2], [0, 6, 7]]).self_contacts()) == 1
    assert len(MeshTree(pierced, [[0, 1, 2], [0, 5, 7]]).self_contacts()) == 0
    twice = MeshTree(flat, [[0, 1, 2], [2, 1, 0]])
    assert twice.self_contacts().faces.tolist() == [[0, 1]]
    with pytest.raises(ValueError, match="limit: more than 1 "):
        MeshTree(flat, [[0, 1, 2]] * 3).self_contacts(limit=1)


def test_open_and_inverted_meshes_say_where():
    tree = box([0, 0, 0], [1, 1, 1])
    lid = MeshTree(tree.vertices, tree.faces[1:])
    with pytest.raises(
        ValueError, match=r"the mesh is open, 3 edges .* of face \d+ has no partner"
    ):
        lid.contains([[0, 0, 0]])
    with pytest.raises(ValueError, match="the mesh is open"):
        lid.signed_distance([[0, 0, 0]])
    assert not lid.closed
    turned = tree.faces.copy()
    turned[[2, 7]] = turned[[2, 7], ::-1]
    with pytest.raises(ValueError, match=r"faces: 2 are inverted .*rows 2, 7\); exchange"):
        MeshTree(tree.vertices, turned).contains([[0, 0, 0]])
    with pytest.raises(ValueError, match="faces: all are inverted"):
        MeshTree(tree.vertices, tree.faces[:, ::-1]).contains([[0, 0, 0]])
    for directions in ([[0, 0, 0]], [[0, 0, 1], [0, 0, 0]]):
        with pytest.raises(ValueError, match=r"directions: \[0. 0. 0.\] in row"):
            tree.cast([0, 0, 0], directions)
    with pytest.raises(ValueError, match="directions: 2 rows, expected 3 or 1"):
        tree.cast(np.zeros((3, 3)), np.ones((2, 3)))
    with pytest.raises(ValueError, match="points: "):
        tree.contains([[0, 0, np.nan]])
    with pytest.raises(ValueError, match=r"points: .* in row 1, expected coordinates to 1e100"):
        tree.signed_distance([[0, 0, 0], [0, 0, 1e101]])
    far = tree.signed_distance([[1e100, 0, 0]])
    assert far.distance[0] == pytest.approx(1e100)


def test_empty_batches_and_threads():
    tree, none = ball(1), np.zeros((0, 3))
    assert tree.contains(none).shape == (0,)
    assert tree.signed_distance(none).point.shape == (0, 3)
    assert tree.cast(none, none).normal.shape == (0, 3)
    points = np.random.default_rng(5).uniform(-1, 1, (500, 3))
    one, two = (tree.signed_distance(points, threads=n) for n in (1, 2))
    assert np.array_equal(one.distance, two.distance)
    assert np.array_equal(one.face, two.face)
