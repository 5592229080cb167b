"""Time of impact against bisection of the exact overlap test, and analytic cases."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tauguard.rigid import (
    Boxes,
    Hulls,
    MeshTree,
    Motion,
    Polygons,
    Tetrahedra,
    overlap,
    time_of_impact,
)
from tauguard.rigid.comparators import ComparedTree

REST = Motion(np.eye(4), np.zeros(3), np.zeros(3))
CUBE_FACES = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)]
CUBE_FACES += [(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]
CUBE = 0.5 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])


def motions(rng, n, reach=2.0):
    pose = np.tile(np.eye(4), (n, 1, 1))
    pose[:, :3, :3] = Rotation.random(n, random_state=rng).as_matrix()
    pose[:, :3, 3] = rng.uniform(-reach, reach, (n, 3))
    return Motion(pose, *rng.uniform(-2, 2, (2, n, 3)))


def placed(bodies, motion, t):
    pose = motion.at(t)
    if isinstance(bodies, Boxes):
        center = pose[:, :3, 3] + np.einsum("nij,nj->ni", pose[:, :3, :3], bodies.center)
        return Boxes(center, bodies.half_extents, pose[:, :3, :3] @ bodies.rotation)
    moved = np.einsum("nij,nkj->nki", pose[:, :3, :3], bodies.vertices)
    return Tetrahedra(moved + pose[:, None, :3, 3])


def bisected(a, b, ma, mb, samples=150):
    """The first time at which the exact test says hit, inf where no sample does."""
    n = len(a)
    hits = np.array(
        [overlap(placed(a, ma, t), placed(b, mb, t)).hit for t in np.linspace(0, 1, samples + 1)]
    )
    first = hits.argmax(axis=0)
    hi = first / samples
    lo = np.maximum(first - 1, 0) / samples
    for _ in range(50):
        middle = 0.5 * (lo + hi)
        hit = overlap(placed(a, ma, middle), placed(b, mb, middle)).hit
        lo, hi = np.where(hit, lo, middle), np.where(hit, middle, hi)
    assert len(hi) == n
    return np.where(hits.any(axis=0), hi, np.inf)


def bodies(kind, rng, n):
    if kind == "tetrahedra":
        return Tetrahedra(rng.uniform(-1, 1, (n, 4, 3)))
    return Boxes(np.zeros((n, 3)), rng.uniform(0.2, 1, (n, 3)), np.tile(np.eye(3), (n, 1, 1)))


@pytest.mark.parametrize("kind", ["boxes", "tetrahedra"])
def test_never_late_never_missed_and_close(kind):
    rng = np.random.default_rng(1)
    n = 400
    a, b, ma, mb = bodies(kind, rng, n), bodies(kind, rng, n), motions(rng, n), motions(rng, n)
    ours, truth = time_of_impact(a, b, ma, mb), bisected(a, b, ma, mb)
    found = np.isfinite(truth)
    assert found.sum() > 40
    assert ours.hit[found].all()
    assert (ours.time_of_impact[found] <= truth[found] + 1e-13).all()
    assert (
        truth[found] - ours.time_of_impact[found] <= 1e-7
    ).mean() > 0.99  # a graze between two samples
    start = ours.time_of_impact == 0
    np.testing.assert_array_equal(start, truth <= 0)
    later = ours.hit & ~start
    np.testing.assert_allclose(np.linalg.norm(ours.normal[later], axis=1), 1.0)
    assert np.isinf(ours.time_of_impact[~ours.hit]).all()
    assert np.isnan(ours.point[~ours.hit]).all()


def test_a_cube_falls_on_a_cube():
    box = Boxes(np.zeros((1, 3)), np.full((1, 3), 0.5), np.eye(3)[None])
    pose = np.eye(4)
    pose[2, 3] = 2.0
    got = time_of_impact(box, box, REST, Motion(pose, [0, 0, -4.0], np.zeros(3)))
    np.testing.assert_allclose(got.time_of_impact, 0.25, atol=1e-12)
    np.testing.assert_allclose(got.normal, [[0, 0, 1]], atol=1e-12)
    np.testing.assert_allclose(got.point[0, 2], 0.5, atol=1e-12)


def test_a_spinning_rod_hits_at_the_angle_that_geometry_says():
    # A thin rod about z through the origin reaches the point (cos 1, sin 1) at angle 1.
    post = Hulls(np.array([[0.5 * np.cos(1), 0.5 * np.sin(1), 0.0]]), np.array([0, 1]))
    spin = Motion(np.eye(4), np.zeros(3), [0, 0, 2.0])
    rod = Hulls(np.array([[x, 0.0, z] for x in (0.0, 1.0) for z in (-0.1, 0.1)]), np.array([0, 4]))
    got = time_of_impact(rod, post, spin, REST)
    np.testing.assert_allclose(got.time_of_impact, 0.5, atol=1e-9)


def test_touching_at_the_start_is_a_hit_at_zero():
    box = Boxes(np.zeros((1, 3)), np.full((1, 3), 0.5), np.eye(3)[None])
    pose = np.eye(4)
    pose[0, 3] = 1.0
    assert (
        time_of_impact(box, box, REST, Motion(pose, [1.0, 0, 0], np.zeros(3))).time_of_impact[0]
        == 0
    )


def repeated(motion, i, n):
    """Row i of a motion, n times."""
    fields = motion.pose_t0[i], motion.linear[i], motion.angular[i]
    return Motion(*(np.repeat(x[None], n, axis=0) for x in fields))


@pytest.mark.parametrize(
    ("distance", "linear", "angular"),
    [
        (1.5, 1.0, 0.0),
        (1.5, 2.0, 2.0),
        (1.5, 0.3, 25.0),
        (80.0, 160.0, 3.0),
        (3.0, 1e4, 0.0),
        (3.0, 1e12, 0.0),
    ],
    ids=["sweep", "turn", "spin", "bullet", "faster bullet", "fastest"],
)
def test_meshes_touch_when_the_first_of_all_their_triangles_do(distance, linear, angular):
    rng = np.random.default_rng(7)
    corners = rng.uniform(-1, 1, (2, 12, 1, 3)) + rng.uniform(-0.4, 0.4, (2, 12, 3, 3))
    i, j = (x.ravel() for x in np.indices((12, 12)))
    a, b = (
        Hulls(c[k].reshape(-1, 3), 3 * np.arange(145)) for c, k in zip(corners, (i, j), strict=True)
    )
    pose = np.tile(np.eye(4), (2, 8, 1, 1))
    pose[:, :, :3, :3] = Rotation.random(16, random_state=rng).as_matrix().reshape(2, 8, 3, 3)
    way = rng.normal(size=(8, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    pose[1, :, :3, 3] = distance * way
    pose[:, :, :3, 3] += 5.0
    aim = -linear * way + 0.3 * rng.normal(size=(8, 3))
    turn = angular * rng.uniform(-1, 1, (2, 8, 3))
    ma, mb = Motion(pose[0], np.full((8, 3), 0.2), turn[0]), Motion(pose[1], aim, turn[1])
    truth = [
        time_of_impact(a, b, repeated(ma, k, len(i)), repeated(mb, k, len(i))).time_of_impact.min()
        for k in range(8)
    ]
    assert np.isfinite(truth).sum() >= 3
    faces = np.arange(36).reshape(12, 3)
    for volume in ("obb", "aabb", "k_dop", "sphere"):
        x, y = (ComparedTree(c.reshape(-1, 3), faces, volume) for c in corners)
        found = time_of_impact(x, y, ma, mb)
        np.testing.assert_allclose(found.time_of_impact, truth, rtol=0, atol=1e-10)
        # Never late, to the rounding of either search.
        assert (found.time_of_impact <= np.array(truth) + 1e-12).all()


def test_meshes_give_the_time_of_their_hulls_and_of_sweeps():
    rng = np.random.default_rng(2)
    tree = MeshTree(CUBE, CUBE_FACES)
    box = Boxes(np.zeros((1, 3)), np.full((1, 3), 0.5), np.eye(3)[None])
    ma, mb = motions(rng, 150, 1.3), motions(rng, 150, 1.3)
    convex, mesh = time_of_impact(box, box, ma, mb), time_of_impact(tree, tree, ma, mb)
    free = ~(convex.time_of_impact == 0)  # a cube inside a cube has no common surface
    np.testing.assert_array_equal(mesh.hit[free], convex.hit[free])
    hit = free & convex.hit
    assert hit.sum() > 5
    np.testing.assert_allclose(mesh.time_of_impact[hit], convex.time_of_impact[hit], atol=1e-9)
    pose = np.eye(4)
    pose[:3, 3] = [2.0, 0.1, 0.2]
    swept = tree.sweep(tree, pose, [-4.0, 0, 0])
    np.testing.assert_allclose(swept.time_of_impact, 0.25, atol=1e-12)
    assert not tree.sweep(tree, pose, [4.0, 0, 0]).hit[0]
    assert tree.sweep(tree, pose, [4.0, 0, 0]).faces.tolist() == [[-1, -1]]


def inside(bodies, motion, t, point):
    """How far each point lies inside its body at its time (negative: outside), by coordinates."""
    pose = motion.at(t)
    own = np.einsum("nji,nj->ni", pose[:, :3, :3], point - pose[:, :3, 3])
    if isinstance(bodies, Boxes):
        return (bodies.half_extents - np.abs(own - bodies.center)).min(axis=1)
    edges = (bodies.vertices[:, 1:] - bodies.vertices[:, :1]).transpose(0, 2, 1)
    weight = np.linalg.solve(edges, (own - bodies.vertices[:, 0])[:, :, None])[:, :, 0]
    return np.minimum(weight.min(axis=1), 1 - weight.sum(axis=1))


@pytest.mark.parametrize("kind", ["boxes", "tetrahedra"])
def test_every_hit_has_a_point_of_both_bodies(kind):
    rng = np.random.default_rng(6)
    n = 300
    a, b, ma, mb = bodies(kind, rng, n), bodies(kind, rng, n), motions(rng, n), motions(rng, n)
    got = time_of_impact(a, b, ma, mb)
    start = got.time_of_impact == 0
    assert min(start.sum(), (got.hit & ~start).sum()) > 10
    assert np.isnan(got.point[~got.hit]).all()
    t = np.where(got.hit, got.time_of_impact, 0.0)
    for body, motion in ((a, ma), (b, mb)):
        assert inside(body, motion, t, got.point)[got.hit].min() > -1e-8


@pytest.mark.parametrize(("k", "j"), [(1, 2), (2, 2), (3, 2), (4, 4)])
def test_flat_hulls_that_meet_in_their_plane(k, j):
    rng = np.random.default_rng(7)
    n = 120
    hulls = []
    for corners in (k, j):
        points = rng.uniform(-1, 1, (n, corners, 3)) * [1, 1, 0]
        hulls.append(Hulls(points.reshape(-1, 3), np.arange(0, n * corners + 1, corners)))
    pose = np.tile(np.eye(4), (n, 1, 1))
    pose[:, :2, 3] = rng.uniform(-2, 2, (n, 2))
    linear, angular = rng.uniform(-2, 2, (2, n, 3)) * [[[1, 1, 0]], [[0, 0, 1]]]
    got = time_of_impact(*hulls, REST, Motion(pose, linear, angular))
    later = np.flatnonzero(got.hit & (got.time_of_impact > 0))
    assert len(later) > 3
    np.testing.assert_array_equal(got.point[got.hit, 2], 0.0)
    np.testing.assert_allclose(np.linalg.norm(got.normal[later, :2], axis=1), 1.0)

    def touching(i, t):
        moved = Motion(pose[i], linear[i], angular[i]).at(t)[0]
        b = hulls[1].vertices[i * j : (i + 1) * j] @ moved[:3, :3].T + moved[:3, 3]
        a = hulls[0].vertices[i * k : (i + 1) * k]
        return overlap(Hulls(a, np.array([0, k])), Hulls(b, np.array([0, j]))).hit[0]

    for i in later:
        assert not touching(i, got.time_of_impact[i] - 1e-9)
        # A point lies on a segment to the last bit only by chance.
        assert k * j == 2 or touching(i, got.time_of_impact[i] + 1e-7)


def test_thread_count_changes_nothing():
    rng = np.random.default_rng(3)
    a, b = (bodies("boxes", rng, 200) for _ in range(2))
    tree = MeshTree(CUBE, CUBE_FACES)
    ma, mb = motions(rng, 200), motions(rng, 200)
    for x, y, extra in ((a, b, ()), (tree, tree, ("faces",))):
        first = time_of_impact(x, y, ma, mb)
        for threads in (2, 5, 0):
            again = time_of_impact(x, y, ma, mb, threads=threads)
            for name in ("hit", "time_of_impact", "point", "normal", *extra):
                assert getattr(first, name).tobytes() == getattr(again, name).tobytes()


def test_bad_input_is_refused():
    box = Boxes(np.zeros((3, 3)), np.ones((3, 3)), np.tile(np.eye(3), (3, 1, 1)))
    two = Motion(np.tile(np.eye(4), (2, 1, 1)), np.zeros((2, 3)), np.zeros((2, 3)))
    with pytest.raises(ValueError, match="motion_a: 2 rows, expected 3 or 1"):
        time_of_impact(box, box, two, REST)
    tree = MeshTree(CUBE, CUBE_FACES)
    with pytest.raises(ValueError, match="motion_b: 2 rows, expected 3 or 1"):
        time_of_impact(box, tree, REST, two)
    polygon = Polygons(np.array([[0.0, 0], [1, 0], [0, 1]]), np.array([0, 3]))
    with pytest.raises(ValueError, match="a: Polygons, expected bodies in space"):
        time_of_impact(polygon, polygon, REST, REST)
    with pytest.raises(ValueError, match="motion_b: a coordinate beyond 1e100"):
        time_of_impact(box, box, REST, Motion(np.eye(4), [1e200, 0, 0], np.zeros(3)))
    for query in (tree.overlap, tree.contacts):
        with pytest.raises(ValueError, match="threads: -1"):
            query(tree, np.eye(4), threads=-1)
    with pytest.raises(ValueError, match="displacement: shape"):
        tree.sweep(tree, np.eye(4), [1.0, 2.0])
