"""Contact manifolds: known corners, MuJoCo's box on a box, and the distance of every pair."""

import itertools

import numpy as np
import pytest

from oracles.curved_bodies import NAMES, Sets
from tauguard.rigid import (
    Boxes,
    Capsules,
    Cones,
    Cylinders,
    HalfSpaces,
    MeshTree,
    Spheres,
    Tetrahedra,
    contacts,
    distance,
)

CUBE = Boxes([[0, 0, 0]], [[1, 1, 1]])
LYING = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]
EDGE = [[1, 0, 0], [0, 0.5**0.5, -(0.5**0.5)], [0, 0.5**0.5, 0.5**0.5]]
SQUARE = [[x, y] for x in (-1, 1) for y in (-1, 1)]
HALF = [[-1, -1], [-1, 1], [0.5, -1], [0.5, 1]]
ENDS = [[-1, 0], [1, 0]]
CAP = [[0.5, 0], [-0.5, 0], [0, 0.5], [0, -0.5]]
CASES = {
    "box on a box": (Boxes([[0, 0, 1.9]], [[1, 1, 1]]), SQUARE, -0.1),
    "box off the middle": (Boxes([[-0.5, 0, 2]], [[1, 2, 1]]), HALF, 0),
    "edge of a box": (Boxes([[0, 0, 2.4]], [[1, 1, 1]], [EDGE]), ENDS, 1.4 - 2**0.5),
    "corner": (Tetrahedra([[[0.2, 0, 0.9], [1, 0, 2], [-1, 0, 2], [0, 1, 2]]]), [[0.2, 0]], -0.1),
    "cylinder stands": (Cylinders([[0, 0, 2]], 0.5, 1), CAP, 0),
    "cylinder lies": (Cylinders([[0, 0, 1.4]], 0.5, 3, LYING), ENDS, -0.1),
    "cone stands": (Cones([[0, 0, 1.9]], 0.5, 1), CAP, -0.1),
    "apex": (Cones([[0.2, 0, 1.9]], 0.5, 1, [-np.eye(3)]), [[0.2, 0]], -0.1),
    "ball": (Spheres([[0.2, 0, 1.5]], 0.5), [[0.2, 0]], 0),
    "capsule lies": (Capsules([[-3, 0, 1.4]], [[3, 0, 1.4]], 0.5), ENDS, -0.1),
}


@pytest.mark.parametrize("name", CASES)
def test_known_points_on_a_cube(name):
    top, want, depth = CASES[name]
    for a, b, sign in ((CUBE, top, 1), (top, CUBE, -1)):
        got = contacts(a, b)
        points = got.point[:, :2]
        assert len(points) == len(want)
        gaps = np.linalg.norm(points[:, None] - np.array(want)[None], axis=2)
        assert gaps.min(axis=0).max() <= 1e-9
        np.testing.assert_allclose(got.distance, depth, atol=1e-9)
        np.testing.assert_allclose(got.normal, [[0, 0, sign]] * len(want), atol=1e-9)
        np.testing.assert_allclose(got.point[:, 2], 1 + depth / 2, atol=1e-9)


@pytest.mark.parametrize("name", [n for n in CASES if n not in ("box off the middle", "apex")])
def test_half_space_below(name):
    top, _, depth = CASES[name]
    got = contacts(HalfSpaces([[0, 0, 1]], 1), top)
    np.testing.assert_allclose(got.distance, depth, atol=1e-9)
    np.testing.assert_allclose(got.point_a[:, 2], 1, atol=1e-12)


def test_a_tilted_box_and_a_margin():
    c, s = np.cos(0.01), np.sin(0.01)
    tilted = Boxes([[0.25, 0, 2]], [[0.5, 0.5, 1]], [[[c, 0, s], [0, 1, 0], [-s, 0, c]]])
    assert len(contacts(CUBE, tilted)) == 2
    got = contacts(CUBE, tilted, margin=0.02)
    assert len(got) == 4
    corners = (
        np.array([[x, y, -1] for x in (-0.5, 0.5) for y in (-0.5, 0.5)]) @ tilted.rotation[0].T
    )
    want = np.sort((corners + tilted.center)[:, 2] - 1)
    np.testing.assert_allclose(np.sort(got.distance), want, atol=1e-9)
    assert len(contacts(CUBE, Spheres([[0, 0, 2.5]], 1), margin=0.4)) == 0


def test_boxes_of_mujoco():
    import mujoco

    spec = mujoco.MjModel.from_xml_string("""
<mujoco><worldbody><geom type="box" size="1 1 1"/>
  <body pos="0.3 0.2 1.45"><freejoint/><geom type="box" size=".8 .6 .5"/></body>
</worldbody></mujoco>""")
    data = mujoco.MjData(spec)
    mujoco.mj_forward(spec, data)
    want = np.array([c.pos for c in data.contact])
    got = contacts(Boxes.from_mujoco(spec, 0), Boxes.from_mujoco(spec, 1), pose_b=pose(data, 1))
    assert len(got) == len(want) == 4
    gaps = np.linalg.norm(got.point[:, None] - want[None], axis=2)
    assert gaps.min(axis=0).max() <= 1e-6
    np.testing.assert_allclose(got.distance, [c.dist for c in data.contact], atol=1e-9)


def pose(data, body):
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = data.xmat[body].reshape(3, 3), data.xpos[body]
    return out


@pytest.mark.parametrize("kinds", list(itertools.product(NAMES, NAMES)), ids="-".join)
def test_the_first_contact_is_the_distance(kinds):
    rng = np.random.default_rng(6)
    n, margin = 60, 0.1
    a, b = (Sets(kind, rng, n).bodies() for kind in kinds)
    near, got = distance(a, b), contacts(a, b, margin)
    first = np.unique(got.pair, return_index=True)
    np.testing.assert_array_equal(first[0], np.flatnonzero(near.distance <= margin))
    np.testing.assert_allclose(got.distance[first[1]], near.distance[first[0]], atol=2e-5)
    assert (got.distance <= margin).all()
    assert (np.bincount(got.pair, minlength=n) <= 4).all()
    np.testing.assert_array_equal(got.normal, near.normal[got.pair])
    along = np.einsum("ij,ij->i", got.point_b - got.point_a, got.normal)
    np.testing.assert_allclose(along, got.distance, atol=1e-9)
    # The points are on the bodies, up to the curvature of features that are nearly flat.
    for bodies, points in ((a, got.point_a), (b, got.point_b)):
        off = distance(bodies[got.pair], Spheres(points, 0)).distance
        assert off.max(initial=0) <= 0.0524 * 3


BAD = [
    (lambda: contacts(CUBE, CUBE, -1), "margin: -1, expected a length of 0 or more"),
    (lambda: contacts(CUBE, CUBE, np.eye(4)), "margin: array"),
    (lambda: contacts(MeshTree(np.eye(3), [[0, 1, 2]]), CUBE), "a: MeshTree, expected convex"),
]  # fmt: skip


@pytest.mark.parametrize(("call", "message"), BAD)
def test_bad_arguments(call, message):
    with pytest.raises(ValueError, match=message):
        call()
