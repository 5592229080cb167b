"""Cylinders, cones, ellipsoids and half-spaces: bounds of every distance, formulas, fractions."""

import itertools
from dataclasses import fields
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from oracles.convex_bodies import KINDS
from oracles.convex_overlap import exact_vertices
from oracles.curved_bodies import CURVED, NAMES, Sets, errors_of
from tauguard.rigid import (
    Boxes,
    Capsules,
    Cones,
    Cylinders,
    Ellipsoids,
    HalfSpaces,
    Hulls,
    Motion,
    Rounded,
    Shape,
    Spheres,
    distance,
    overlap,
    time_of_impact,
)

#: The stated bound of the error, relative to the size of a pair.
BOUND = 1e-9
PAIRS = [p for p in itertools.combinations_with_replacement(NAMES, 2) if set(p) & set(CURVED)]


@pytest.mark.parametrize("kinds", PAIRS, ids="-".join)
def test_distances_lie_between_bounds_of_numpy(kinds):
    rng = np.random.default_rng(5)
    a, b = (Sets(kind, rng, 400) for kind in kinds)
    got = distance(a.bodies(), b.bodies())
    assert 40 < (got.distance > 0).sum() < 390
    assert errors_of(a, b, got, searched=30).max() <= BOUND
    np.testing.assert_array_equal(overlap(a.bodies(), b.bodies()).hit, got.distance <= 0)
    swapped = distance(b.bodies(), a.bodies())
    np.testing.assert_allclose(swapped.distance, got.distance, atol=2e-9 * 6)


UP = [0, 0, 1.0]
X = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]  # turns the z axis to x
HERE = [[0, 0, 0]]
CUBE, CAN = Boxes(HERE, [[1, 1, 1]]), Cylinders(HERE, 1, 1)


def at(z):
    return [[0, 0, z]]


CASES = {
    "cylinder stands on a box": (Cylinders(at(2), 0.5, 1), CUBE, 0),
    "cylinder lies on a box": (Cylinders(at(1.5), 0.5, 2, [X]), Boxes(HERE, [[3, 3, 1]]), 0),
    "cylinder over a box": (Cylinders(at(2.25), 0.5, 1), CUBE, 0.25),
    "cylinders side by side": (CAN, Cylinders([[3, 0, 0]], 0.5, 1), 1.5),
    "crossed cylinders": (Cylinders(HERE, 0.5, 2), Cylinders([[0, 2, 0]], 0.5, 2, [X]), 1.0),
    "coaxial cylinders": (CAN, Cylinders(at(3), 1, 1), 1.0),
    "concentric cylinders": (Cylinders(HERE, 1, 9), Cylinders(HERE, 0.5, 9), -1.5),
    "cylinder in a cylinder, short": (Cylinders(HERE, 9, 1), CAN, -2),
    "rim over rim": (CAN, Cylinders([[5, 0, 4]], 1, 1), 13**0.5),
    "apex on a face": (Cones(at(-1), 1, 1), Boxes(at(1), [[1, 1, 1]]), 0),
    "apex over apex": (Cones(HERE, 1, 1), Cones(at(3), 1, 1, [-np.eye(3)]), 1),
    "base on a box": (Cones(at(2), 1, 1), CUBE, 0),
    "ball beside a cone": (Cones(HERE, 3, 2), Spheres([[4, 0, 1]], 0.5), 2.1),
    "ellipsoid on a plate": (Ellipsoids(at(3), [[1, 2, 3]]), Boxes(at(-1), [[9, 9, 1]]), 0),
    "ball-like ellipsoids": (
        Ellipsoids(HERE, [[1, 1, 1]]),
        Ellipsoids([[3, 0, 0]], [[1, 1, 1]]),
        1,
    ),
    "concentric ellipsoids": (Ellipsoids(HERE, [[1, 2, 3]]), Ellipsoids(HERE, [[1, 2, 3]]), -2),
    "point in a cylinder": (Spheres([[0.25, 0, 0]], 0), Cylinders(HERE, 1, 5), -0.75),
    "rounded cylinders": (Rounded(CAN, 0.5), Rounded(Cones(at(4), 1, 1), 0.25), 1.25),
    "capsule along a cylinder": (Capsules([[2, 0, -1]], [[2, 0, 1]], 0.5), CAN, 0.5),
    "tiny by huge": (Cylinders(at(1e8 + 1), 1e-3, 0.5), Ellipsoids(HERE, [[1e8, 1e8, 1e8]]), 0.5),
    "needle over a disc": (Cylinders(at(2), 1e-6, 1), Cylinders(at(-1e-7), 5, 1e-7), 1),
    "half-space under a cylinder": (HalfSpaces([UP], 1), Cylinders(at(3), 1, 0.5, [X]), 1),
    "half-space under a cone": (HalfSpaces([UP], 1), Cones(at(3), 1, 0.5), 1.5),
    "half-space in an ellipsoid": (HalfSpaces([UP], 1), Ellipsoids(at(3), [[1, 1, 2.5]]), -0.5),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("power", [0, 200, -200])
def test_formulas(name, power):
    a, b, want = CASES[name]
    a, b, scale = scaled(a, power), scaled(b, power), 2.0**power
    size = max(np.abs(np.ldexp(s.packed, -power)[..., :6]).max() for s in (core(a), core(b)))
    for first, second in ((a, b), (b, a)):
        got = distance(first, second)
        assert got.distance[0] / scale == pytest.approx(want, abs=BOUND * size)
        gap = (got.point_b - got.point_a)[0] @ got.normal[0]
        assert gap / scale == pytest.approx(want, abs=BOUND * size)
        if abs(want) > BOUND * size:
            assert overlap(first, second).hit[0] == (want < 0)


def core(solid):
    return getattr(solid, "core", solid)


def scaled(solid, power):
    by = {"rotation": 1, "normal": 1}
    values = {f.name: getattr(solid, f.name) for f in fields(solid) if f.init}
    if "core" in values:
        return Rounded(scaled(values["core"], power), values["radius"] * 2.0**power)
    return type(solid)(*(value * by.get(name, 2.0**power) for name, value in values.items()))


numbers = st.one_of(st.integers(-2, 2).map(float), st.floats(-1e3, 1e3, width=32))


@settings(max_examples=150, deadline=None)
@example([0.0] * 10 + [1e-9, 100.0], 0.0, 0.0, (0, -1, 0))
@given(st.lists(numbers, min_size=12, max_size=12), numbers, st.sampled_from([0, 0.5, 2.0]),
       st.sampled_from([(0, 0, 1), (0, -1, 0), (0.6, 0.8, 0), (1 / 3, 2 / 3, 2 / 3)]))  # fmt: skip
def test_half_spaces_and_hulls_are_exact(values, offset, radius, normal):
    points = np.array(values).reshape(4, 3)
    plane = HalfSpaces([normal], offset)
    body = Rounded(Hulls(points, [0, 4]), radius)
    low = min(
        sum(Fraction(n) * Fraction(x) for n, x in zip(normal, p, strict=True)) for p in points
    )
    square = sum(Fraction(n) ** 2 for n in normal)
    height = low - Fraction(offset)
    hit = height <= 0 or height**2 <= Fraction(radius) ** 2 * square
    got = distance(plane, body)
    assert (
        overlap(plane, body).hit[0] == overlap(body, plane).hit[0] == hit == (got.distance[0] <= 0)
    )
    want = float(height) / float(square) ** 0.5 - radius
    assert got.distance[0] == pytest.approx(
        want, abs=3e-14 * (np.abs(points).max() + abs(offset) + 3)
    )


@pytest.mark.parametrize("kind", ["boxes", "tetrahedra", "parallelepipeds"])
def test_half_spaces_far_from_the_origin(kind):
    rng = np.random.default_rng(4)
    bodies = KINDS[kind](rng, 200)
    normal = rng.normal(size=(200, 3))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    far = 1e7 * rng.uniform(-1, 1, 200)
    pose = np.tile(np.eye(4), (200, 1, 1))
    pose[:, :3, 3] = far[:, None] * normal
    got = distance(HalfSpaces(normal, far), bodies, pose_b=pose)
    moved = distance(HalfSpaces(normal, far), bodies, pose_b=pose).distance
    np.testing.assert_array_equal(got.distance, moved)
    for i in range(0, 200, 10):
        n, c = [Fraction(x) for x in normal[i]], Fraction(far[i])
        shift = [Fraction(x) for x in pose[i, :3, 3]]
        low = min(
            sum(m * (Fraction(x) + t) for m, x, t in zip(n, v, shift, strict=True))
            for v in exact_vertices(bodies, i)[0]
        )
        assert got.distance[i] == pytest.approx(float(low - c), abs=1e-8)  # rounded poses


def test_witnesses():
    rng = np.random.default_rng(8)
    a, b = Sets("cylinders", rng, 300), Sets("cones", rng, 300)
    result = overlap(a.bodies(), b.bodies())
    w, hit = result.witness, result.hit
    for sets in (a, b):
        assert sets.outside(np.nan_to_num(w.point))[hit].max() <= 1e-9
    low = a.height(np.nan_to_num(w.normal)[:, None])[:, 0]
    high = -b.height(-np.nan_to_num(w.normal)[:, None])[:, 0]
    assert ((low <= w.offset + 1e-9) & (w.offset <= high + 1e-9))[~hit].all()


def test_rows_slices_masks_and_loops_give_batches():
    rng = np.random.default_rng(1)
    for kind in NAMES:
        bodies = Sets(kind, rng, 5).bodies()
        whole = distance(bodies, Spheres([[0, 0, 0]], 0.1)).distance
        for rows in (2, -1, slice(1, 4), [4, 0], np.array([True, False, True, False, False]), []):
            part = bodies[rows]
            assert type(part) is type(bodies)
            assert len(part) == len(np.atleast_1d(whole[rows]))
            some = distance(part, Spheres([[0, 0, 0]], 0.1)).distance
            np.testing.assert_array_equal(some, np.atleast_1d(whole[rows]))
        assert [len(body) for body in bodies] == [1] * 5
        assert repr(bodies).startswith(type(bodies).__name__)
        with pytest.raises(IndexError):
            bodies[5]
    rounded = Rounded(Sets("cones", rng, 3).bodies(), [1, 2, 3])
    assert rounded[1].radius == [2]
    assert len(rounded[1:].core) == 2


BAD = [
    (lambda: Cylinders(HERE, 0, 1), "radius: 0.0 in row 0; expected more than 0; a segment"),
    (lambda: Cylinders(np.zeros((2, 3)), 1, [1, -1]), r"half_length: -1.0 in row 1; .* a disc is"),
    (lambda: Cones(HERE, [1, 2], 1), r"radius: shape \(2,\), expected \(1\)"),
    (lambda: Ellipsoids(HERE, [[1, 0, 1]]), "radii: 0.0 in row 0; expected more than 0"),
    (lambda: HalfSpaces([[0, 0, 1], [0, 0, 2]], 0), "normal: length 2 in row 1, .* divide normal"),
    (lambda: HalfSpaces(HERE, 0), "normal: length 0 in row 0, .* give a direction"),
    (lambda: Boxes(HERE, [[1, 1, 1]], [[1, 0, 0, 0]]), "quaternions .* scalar_first=True"),
    (lambda: Cones(HERE, 1, 1, [np.eye(3) * 1.00001]), r"row 0 .* by 2e-05, .* u @ vt"),
    (lambda: distance(HalfSpaces([UP], 0), HalfSpaces([UP], 0)), "a, b: two HalfSpaces"),
    (lambda: Cones.from_coal([]), "shapes: none"),
    (lambda: distance(Spheres(HERE, 1), 3), "b: int, expected one of .* Cylinders, Cones"),
]  # fmt: skip


@pytest.mark.parametrize(("call", "message"), BAD)
def test_bad_arguments(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_from_mujoco():
    import mujoco

    model = mujoco.MjModel.from_xml_string("""
<mujoco><worldbody>
  <geom name="floor" type="plane" size="1 1 1" pos="0 0 -1"/>
  <body pos="1 2 3" euler="10 20 30"><freejoint/>
    <geom name="can" type="cylinder" size=".2 .5" pos=".1 .2 .3" euler="40 50 60"/>
    <geom name="egg" type="ellipsoid" size=".2 .5 .3" pos="1 .2 .3" euler="40 50 60"/>
    <geom name="pin" type="capsule" size=".2 .5" pos=".1 1.2 .3" euler="40 50 60"/>
    <geom name="brick" type="box" size=".2 .5 .1" pos=".1 .2 1.3" euler="4 50 60"/>
    <geom name="ball" type="sphere" size=".2" pos="-1 .2 .3"/>
  </body></worldbody></mujoco>""")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = data.xmat[1].reshape(3, 3), data.xpos[1]
    names = ("can", "egg", "pin", "brick", "ball")
    for x, y in itertools.combinations(names, 2):
        a, b = Shape.from_mujoco(model, x), Shape.from_mujoco(model, model.geom(y).id)
        ids = model.geom(x).id, model.geom(y).id
        want = mujoco.mj_geomDistance(model, data, *ids, 10, None)
        if want > 0:
            got = distance(a, b, pose_a=pose, pose_b=pose).distance[0]
            assert got == pytest.approx(want, abs=1e-5)  # MuJoCo's own tolerance is 1e-6
    floor = HalfSpaces.from_mujoco(model, "floor")
    assert distance(floor, Shape.from_mujoco(model, ["ball"]), pose_b=pose).distance[0] > 1
    with pytest.raises(ValueError, match="no geom 'cup'; the model has floor, can"):
        Cylinders.from_mujoco(model, "cup")
    with pytest.raises(ValueError, match="Cones: these are Cylinders; use Cylinders or Shape"):
        Cones.from_mujoco(model, "can")
    with pytest.raises(ValueError, match="geoms: mjGEOM_CYLINDER, mjGEOM_ELLIPSOID"):
        Shape.from_mujoco(model, ["can", "egg"])


def test_from_coal_and_trimesh():
    import coal
    import trimesh

    shapes = [coal.Box(1, 2, 3), coal.Sphere(0.5), coal.Capsule(0.3, 1), coal.Cylinder(0.5, 2),
              coal.Cone(0.5, 2), coal.Ellipsoid(0.5, 1, 2)]  # fmt: skip
    place = coal.Transform3s(np.eye(3), np.array([4.0, 1, 0.5]))
    pose = np.eye(4)
    pose[:3, 3] = [4, 1, 0.5]
    for x, y in itertools.product(shapes, shapes):
        out = coal.DistanceResult()
        want = coal.distance(x, coal.Transform3s.Identity(), y, place, coal.DistanceRequest(), out)
        got = distance(Shape.from_coal(x), Shape.from_coal([y]), pose_b=pose).distance[0]
        assert got == pytest.approx(want, abs=1e-5)
    plane = HalfSpaces.from_coal(coal.Halfspace(np.array([0, 0, 1.0]), -2))
    assert distance(plane, Boxes.from_coal(shapes[0])).distance[0] == 0.5
    ball = Hulls.from_trimesh([trimesh.creation.icosphere(2)])
    assert distance(ball, Boxes.from_coal(shapes[0]), pose_b=pose).distance[0] > 2
    with pytest.raises(ValueError, match=r"b: Box, expected one of .*; Shape\.from_coal"):
        distance(ball, shapes[0])


@pytest.mark.parametrize("top", [Cylinders(at(3), 0.5, 1), Ellipsoids(at(3), [[1, 2, 1]])])
def test_time_of_impact(top):
    rest = Motion(np.eye(4), [0, 0, 0], [0, 0, 0])
    fall = Motion(np.eye(4), [0, 0, -4.0], [0, 0, 0])
    for below in (CUBE, CAN, HalfSpaces([UP], 1), Rounded(Boxes(HERE, [[1, 1, 0.5]]), 0.5)):
        got = time_of_impact(below, top, rest, fall)
        assert got.hit[0]
        assert 0.25 - 1e-6 <= got.time_of_impact[0] <= 0.25
        np.testing.assert_allclose(got.normal[0], UP, atol=1e-6)
        back = time_of_impact(top, below, fall, rest)
        assert back.time_of_impact[0] == pytest.approx(got.time_of_impact[0], abs=1e-8)
