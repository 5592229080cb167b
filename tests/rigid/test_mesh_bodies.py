"""A mesh against convex bodies: the answers of all its triangles, formulas, refusals."""

import numpy as np
import pytest
import trimesh

from oracles.moving_bodies import REST, as_hulls, corners_of, motions, placed, rounded
from tauguard.rigid import (
    Boxes,
    Capsules,
    Cylinders,
    Hulls,
    MeshTree,
    Motion,
    Rounded,
    Spheres,
    Tetrahedra,
    distance,
    overlap,
    sweep,
    time_of_impact,
)
from tauguard.rigid.comparators import ComparedTree
from tauguard.rigid.rounded import parts


def soup(rng, n=40):
    """Triangles anywhere, some degenerate."""
    corners = rng.uniform(-1, 1, (n, 1, 3)) + rng.uniform(-0.3, 0.3, (n, 3, 3))
    corners[0, 2] = corners[0, 1]
    corners[1] = corners[1, 0]
    return corners, MeshTree(corners.reshape(-1, 3), np.arange(3 * n).reshape(n, 3))


@pytest.mark.parametrize("volume", ["obb", "aabb", "k_dop", "sphere"])
@pytest.mark.parametrize("kind", ["spheres", "capsules", "rounded boxes", "tetrahedra", "boxes"])
def test_a_mesh_answers_as_all_its_triangles(kind, volume):
    rng = np.random.default_rng(74)
    corners, tree = soup(rng)
    tree = ComparedTree(tree.vertices, tree.faces, volume)
    n, m = 30, len(corners)
    body = rounded(kind, rng, n)
    at = placed(body, motions(rng, n, 1.5), 0.0)
    row, face = (x.ravel() for x in np.indices((n, m)))
    triangles = Hulls(corners[face].reshape(-1, 3), 3 * np.arange(n * m + 1))
    clouds = [at.core.vertices[at.core.offsets[i] : at.core.offsets[i + 1]] for i in row]
    bodies = Rounded(as_hulls(clouds), at.radius[row])
    each = distance(triangles, bodies)
    table = each.distance.reshape(n, m)
    got, met = distance(tree, at), overlap(tree, at)
    np.testing.assert_array_equal(got.distance, table.min(axis=1))
    np.testing.assert_array_equal(table[np.arange(n), got.face], got.distance)
    np.testing.assert_array_equal(met.hit, got.distance <= 0)
    assert 3 < met.hit.sum() < n - 3
    assert (table[np.arange(n), met.faces[:, 0]][met.hit] <= 0).all()
    assert (met.faces[:, 1] == -1).all()
    np.testing.assert_array_equal(met.faces[~met.hit], -1)
    back, met_back = distance(at, tree), overlap(at, tree)
    np.testing.assert_array_equal(back.distance, got.distance)
    np.testing.assert_array_equal(back.normal, -got.normal)
    np.testing.assert_array_equal(back.point_a, got.point_b)
    np.testing.assert_array_equal(met_back.faces, met.faces[:, ::-1])


@pytest.mark.parametrize("kind", ["spheres", "capsules", "rounded boxes", "boxes"])
@pytest.mark.parametrize(("reach", "speed"), [(2.0, 2.0), (2.0, 20.0), (200.0, 400.0)])
def test_a_mesh_is_touched_when_the_first_of_its_triangles_is(kind, reach, speed):
    rng = np.random.default_rng(75)
    corners, tree = soup(rng)
    n, m = 20, len(corners)
    body = rounded(kind, rng, n)
    way = rng.normal(size=(n, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    mesh_motion = motions(rng, n, 0.3, 1.0)
    start = motions(rng, n, 0.3)
    pose = start.pose_t0.copy()
    pose[:, :3, 3] += reach * way
    motion = Motion(pose, -speed * way, start.angular)
    row, face = (x.ravel() for x in np.indices((n, m)))
    triangles = Hulls(corners[face].reshape(-1, 3), 3 * np.arange(n * m + 1))
    own = corners_of(body)
    clouds = as_hulls([own[i] for i in row])
    radius = np.broadcast_to(parts(body)[1], n)[row]

    def repeated(x):
        return Motion(x.pose_t0[row], x.linear[row], x.angular[row])

    table = time_of_impact(
        triangles, Rounded(clouds, radius), repeated(mesh_motion), repeated(motion)
    ).time_of_impact.reshape(n, m)
    truth = table.min(axis=1)
    got = time_of_impact(tree, body, mesh_motion, motion)
    assert np.isfinite(truth).sum() >= 5
    np.testing.assert_allclose(got.time_of_impact, truth, rtol=0, atol=1e-9)
    hit = np.flatnonzero(got.hit)
    np.testing.assert_allclose(table[hit, got.faces[hit, 0]], truth[hit], atol=1e-9)
    assert (got.faces[:, 1] == -1).all()
    back = time_of_impact(body, tree, motion, mesh_motion)
    np.testing.assert_array_equal(back.time_of_impact, got.time_of_impact)
    np.testing.assert_array_equal(back.faces, got.faces[:, ::-1])
    np.testing.assert_array_equal(back.normal, -got.normal)
    many = time_of_impact(tree, body, mesh_motion, motion, threads=3)
    assert many.time_of_impact.tobytes() == got.time_of_impact.tobytes()


def test_inside_a_closed_mesh_overlap_and_motion_take_the_surface():
    cube = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    faces = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)]
    faces += [(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]
    tree = MeshTree(cube, faces)
    balls = Spheres(np.zeros((4, 3)), [0.5, 1.0, np.nextafter(1.0, 0), 9.0])
    np.testing.assert_array_equal(overlap(tree, balls).hit, [False, True, False, True])
    got = distance(tree, balls).distance
    np.testing.assert_allclose(got, [-1.5, -2.0, -2.0, -10.0])
    move = Motion(np.eye(4), [2.0, 0, 0], np.zeros(3))
    toi = time_of_impact(tree, Spheres([[0, 0, 0]], 0.5), REST, move).time_of_impact
    np.testing.assert_allclose(toi, 0.25, atol=1e-12)


def test_mesh_queries_refuse_what_they_cannot_answer():
    tree = MeshTree(np.eye(3), [[0, 1, 2]])
    ball = Spheres(np.zeros((2, 3)), 1.0)
    with pytest.raises(ValueError, match=r"both are meshes; .*MeshTree\.overlap\(other, pose\)"):
        overlap(tree, tree)  # type: ignore[call-overload]
    with pytest.raises(ValueError, match=r"^a: MeshTree, .*use MeshTree\.sweep for two meshes"):
        sweep(tree, tree, [1, 0, 0])  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"a mesh is MeshTree\(mesh\.vertices, mesh\.faces\)"):
        overlap(trimesh.creation.box(), ball)
    with pytest.raises(ValueError, match="b: a number beyond 1e30"):
        overlap(tree, Spheres(np.full((1, 3), 1e31), 1.0))
    with pytest.raises(ValueError, match=r"tauguard\.rigid\.overlap or distance"):
        tree.overlap(ball, np.eye(4))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="'sat' needs bodies without radii, but a is a MeshTree"):
        overlap(tree, Tetrahedra(np.zeros((1, 4, 3))), "sat")
    none = overlap(tree, Spheres(np.zeros((0, 3)), 1.0))
    assert none.faces.shape == (0, 2)


@pytest.mark.parametrize("other", [5, None, [[0, 0, 0]], np.zeros((2, 3))])
def test_what_is_no_batch_of_bodies_is_named_with_what_works(other):
    tree = MeshTree(np.eye(3), [[0, 1, 2]])
    for query in (overlap, distance, lambda *sides: time_of_impact(*sides, REST, REST)):
        for name, sides in (("b", (tree, other)), ("a", (other, tree))):
            with pytest.raises(
                ValueError, match=f"^{name}: .*, expected one of Tetrahedra"
            ) as error:
                query(*sides)
            assert "\n" not in str(error.value)


def test_a_pose_is_no_motion():
    tree, ball = MeshTree(np.eye(3), [[0, 1, 2]]), Spheres([[0, 0, 2]], 0.5)
    with pytest.raises(ValueError, match="motion_a: a ndarray, expected a Motion"):
        time_of_impact(tree, ball, np.eye(4), REST)


def test_bodies_inside_of_a_closed_mesh_have_a_negative_distance():
    cube = box_tree(2.0)
    inside = {
        "ball": (Spheres([[0, 0, 0.25], [5, 0, 0]], 0.5), [-2.25, 2.5]),
        "box": (Boxes([[0, 0, 0.5]], [[0.25, 0.25, 0.25]]), [-1.75]),
        "cylinder": (Cylinders([[0, 0, 1.0]], 0.25, 0.5), [-1.0]),
        "rod": (Capsules([[0, 0, -1.0]], [[0, 0, 0.5]], 0.25), [-1.75]),
    }
    for bodies, wanted in inside.values():
        found = distance(cube, bodies)
        np.testing.assert_allclose(found.distance, wanted, atol=1e-12)
        gap = np.einsum("ij,ij->i", found.point_b - found.point_a, found.normal)
        np.testing.assert_allclose(gap, wanted, atol=1e-12)
    swapped = distance(Spheres([[0, 0, 0.25]], 0.5), cube)
    np.testing.assert_allclose(swapped.distance, [-2.25])
    assert swapped.normal[0, 2] == -1
    opened = MeshTree(cube.vertices, cube.faces[1:])
    assert distance(opened, Spheres([[0, 0, 0.25]], 0.5)).distance[0] > 0


def box_tree(half):
    """A cube about the origin, closed."""
    shape = trimesh.creation.box(extents=[2 * half] * 3)
    return MeshTree(shape.vertices, shape.faces)
