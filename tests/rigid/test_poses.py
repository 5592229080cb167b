"""Bodies at poses: the same bits as bodies of the transformed numbers."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from oracles.convex_bodies import KINDS
from oracles.curved_bodies import Sets
from tauguard.rigid import (
    Boxes,
    Cones,
    Cylinders,
    Ellipsoids,
    HalfSpaces,
    Hulls,
    MeshTree,
    Motion,
    Parallelepipeds,
    Polygons,
    Spheres,
    Tetrahedra,
    distance,
    overlap,
    sweep,
    time_of_impact,
)

PLACED = (Boxes, Cylinders, Cones, Ellipsoids)


def poses(rng, n, far=1.0):
    out = np.tile(np.eye(4), (n, 1, 1))
    out[:, :3, :3] = Rotation.random(n, rng=rng).as_matrix()
    out[:, :3, 3] = far * rng.uniform(-1, 1, (n, 3))
    return out


def turned(pose, x):
    """R x, added in the order of the native code."""
    r = pose[..., :3, :3]
    return (r[..., 0] * x[..., None, 0] + r[..., 1] * x[..., None, 1]) + r[..., 2] * x[..., None, 2]


def points(pose, x):
    return turned(pose, x) + pose[..., :3, 3]


def moved(bodies, pose):
    """The batch with its numbers transformed in NumPy."""
    if isinstance(bodies, Tetrahedra):
        return Tetrahedra(points(pose[:, None], bodies.vertices))
    if isinstance(bodies, Parallelepipeds):
        return Parallelepipeds(points(pose, bodies.origin), turned(pose[:, None], bodies.edges))
    if isinstance(bodies, Hulls):
        sizes = np.diff(bodies.offsets)
        return Hulls(points(np.repeat(pose, sizes, axis=0), bodies.vertices), bodies.offsets)
    if isinstance(bodies, HalfSpaces):
        normal = turned(pose, bodies.normal)
        n, t = normal, pose[:, :3, 3]
        move = bodies.offset + n[:, 0] * t[:, 0] + n[:, 1] * t[:, 1] + n[:, 2] * t[:, 2]
        return HalfSpaces(normal, move)
    columns = bodies.rotation.transpose(0, 2, 1)
    rotation = turned(pose[:, None], columns).transpose(0, 2, 1)
    center = points(pose, bodies.center)
    sizes = {Boxes: ["half_extents"], Cylinders: ["radius", "half_length"],
             Cones: ["radius", "half_height"], Ellipsoids: ["radii"]}[type(bodies)]  # fmt: skip
    return type(bodies)(center, *(getattr(bodies, name) for name in sizes), rotation)


def batches(rng, n):
    for make in KINDS.values():
        yield make(rng, n)
    for kind in ("hulls", "cylinders", "cones", "ellipsoids"):
        yield Sets(kind, rng, n).bodies()


@pytest.mark.parametrize("far", [1.0, 1e6])
def test_posed_bodies_equal_transformed_ones(far):
    rng = np.random.default_rng(2)
    n = 60
    for first in batches(rng, n):
        for second in batches(rng, n):
            a, b = poses(rng, n, far), poses(rng, n, far)
            b[:, :3, 3] = a[:, :3, 3] + rng.uniform(-1, 1, (n, 3))
            x, y = moved(first, a), moved(second, b)
            want, got = distance(x, y), distance(first, second, pose_a=a, pose_b=b)
            for name in ("distance", "point_a", "point_b", "normal"):
                np.testing.assert_array_equal(getattr(got, name), getattr(want, name))
            hit, both = overlap(first, second, pose_a=a, pose_b=b), overlap(x, y)
            np.testing.assert_array_equal(hit.hit, both.hit)
            np.testing.assert_array_equal(hit.witness.point, both.witness.point)


def test_one_body_against_many_poses_and_the_other_way_round():
    rng = np.random.default_rng(3)
    at = poses(rng, 50)
    one, many = Sets("hulls", rng, 1).bodies(), Sets("boxes", rng, 50).bodies()
    repeated = one[np.zeros(50, dtype=int)]
    want = distance(moved(repeated, at), many).distance
    np.testing.assert_array_equal(distance(one, many, pose_a=at).distance, want)
    np.testing.assert_allclose(distance(many, one, pose_b=at).distance, want, atol=1e-13)
    same = np.broadcast_to(at[0], (50, 4, 4))
    x, y = (distance(one, many, pose_a=pose) for pose in (at[0], same))
    np.testing.assert_array_equal(x.distance, y.distance)
    fall = sweep(one, Boxes([[0, 0, 0]], [[1, 1, 1]]), rng.uniform(-3, 3, (50, 3)), pose_b=at[1])
    assert len(fall.hit) == 50
    rest = Motion(at, [0, 0, 0], [0, 0, 0])
    still = time_of_impact(one, many, rest, Motion(np.eye(4), [0, 0, 0], [0, 0, 0]))
    np.testing.assert_array_equal(still.hit, want <= 0)


@pytest.mark.parametrize("method", ["abfme", "sat", "auto"])
def test_methods_and_sweeps_of_posed_polytopes(method):
    rng = np.random.default_rng(4)
    n = 100
    first, second = KINDS["boxes"](rng, n), KINDS["tetrahedra"](rng, n)
    a, b, move = poses(rng, n), poses(rng, n, 2), rng.uniform(-2, 2, (n, 3))
    x, y = moved(first, a), moved(second, b)
    hit = overlap(first, second, method, pose_a=a, pose_b=b).hit
    np.testing.assert_array_equal(hit, overlap(x, y).hit)
    got, want = sweep(first, second, move, method, pose_a=a, pose_b=b), sweep(x, y, move, method)
    np.testing.assert_array_equal(got.time_of_impact, want.time_of_impact)
    np.testing.assert_array_equal(got.normal, want.normal)


def test_half_spaces_and_meshes_at_poses():
    rng = np.random.default_rng(5)
    at = poses(rng, 40)
    normal = np.array([[0.6, 0, 0.8]])
    plane, ball = HalfSpaces(normal, 0.5), Spheres([[0.1, 0.2, 0.3]], 0.25)
    want = distance(moved(HalfSpaces(np.repeat(normal, 40, 0), 0.5), at), ball).distance
    np.testing.assert_array_equal(distance(plane, ball, pose_a=at).distance, want)
    tree = MeshTree([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2], [1, 2, 3]])
    box = Boxes([[0, 0, 0]], [[0.2, 0.3, 0.4]])
    many = box[np.zeros(40, dtype=int)]
    want = distance(tree, moved(many, at)).distance
    np.testing.assert_array_equal(distance(tree, box, pose_b=at).distance, want)
    np.testing.assert_array_equal(distance(box, tree, pose_a=at).distance, want)
    np.testing.assert_array_equal(overlap(tree, box, pose_b=at).hit, want <= 0)
    can = Cylinders([[0, 0, 0]], 0.2, 0.3)
    near = distance(tree, can, pose_b=at)
    faces = Tetrahedra(tree.vertices[tree.faces[:, [0, 1, 2, 0]]])
    each = [distance(faces, can, pose_b=p).distance.min() for p in at]
    np.testing.assert_allclose(near.distance, each, atol=1e-9)
    np.testing.assert_array_equal(overlap(tree, can, pose_b=at).hit, near.distance <= 0)


EYE = np.eye(4)
CUBE = Boxes([[0, 0, 0]], [[1, 1, 1]])
TREE = MeshTree(np.eye(3), [[0, 1, 2]])
BAD = [
    (lambda: overlap(CUBE, CUBE, EYE, EYE), "method: an array; poses are passed by name"),
    (lambda: distance(CUBE, CUBE, EYE), "threads: an array; poses are passed by name"),
    (lambda: distance(CUBE, CUBE, pose_a=np.eye(3)), "pose_a: shape .*; for rotations alone"),
    (lambda: distance(CUBE, CUBE, pose_b=np.ones((1, 7))), "pose_b: .*x, y, z, w; with MuJoCo"),
    (lambda: distance(CUBE, CUBE, pose_a=2 * EYE), "pose_a: bottom row .* in row 0"),
    (lambda: distance(CUBE, CUBE, pose_a=[EYE, np.diag([1, 1.0001, 1, 1])]),
     "pose_a: the rotation in row 1 is not proper .* by 0.0002, .* u @ vt"),
    (lambda: distance(CUBE, CUBE, pose_a=[EYE] * 2, pose_b=[EYE] * 3), "pose_a: 2 rows"),
    (lambda: distance(TREE, CUBE, pose_a=EYE), r"pose_a: a is a MeshTree, .*np\.linalg\.inv"),
    (lambda: overlap(Polygons(np.eye(2), [0, 2]), Polygons(np.eye(2), [0, 2]), pose_a=EYE),
     "pose_a: Polygons"),
]  # fmt: skip


@pytest.mark.parametrize(("call", "message"), BAD)
def test_bad_poses(call, message):
    with pytest.raises(ValueError, match=message):
        call()
