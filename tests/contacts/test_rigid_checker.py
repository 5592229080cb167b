"""The rigid checker against closed forms and against MuJoCo's distances along the way."""

import itertools
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.contacts import State, checker, geom_kinds
from tauguard.rigid import Boxes, distance

SHAPES = {
    "sphere": 'size=".1"',
    "capsule": 'size=".05 .1"',
    "ellipsoid": 'size=".1 .07 .05"',
    "cylinder": 'size=".06 .1"',
    "box": 'size=".1 .07 .05"',
    "mesh": 'mesh="rock"',
    "plane": 'size="1 1 1"',
}
ROCK = np.random.default_rng(5).normal(size=(30, 3)) * [0.1, 0.06, 0.08]
ASSET = f'<asset><mesh name="rock" vertex="{" ".join(map(str, ROCK.ravel()))}"/></asset>'


def scene(*geoms, extra=""):
    bodies = "".join(
        f'<geom type="{kind}" {rest}/>'
        if kind == "plane"
        else f'<body><freejoint/><geom type="{kind}" {rest} mass="1"/></body>'
        for kind, rest in geoms
    )
    return mujoco.MjModel.from_xml_string(
        f"<mujoco>{ASSET}<worldbody>{bodies}</worldbody>{extra}</mujoco>"
    )


def states(model, before, after):
    data = mujoco.MjData(model)
    out = []
    for qpos in (before, after):
        data.qpos[:] = qpos
        out.append(State.of(model, data))
    return out


def poses(*positions):
    return np.concatenate([[*p, 1, 0, 0, 0] for p in positions])


positions = st.tuples(*[st.floats(-1, 1)] * 3).map(np.array)


@given(positions, positions, positions, positions)
@settings(deadline=None, max_examples=200)
def test_two_spheres_meet_when_the_quadratic_says(a0, a1, b0, b1):
    model = scene(("sphere", 'size=".2"'), ("sphere", 'size=".3"'))
    found = checker("rigid", model).check(*states(model, poses(a0, b0), poses(a1, b1)))
    p, v = b0 - a0, (b1 - a1) - (b0 - a0)
    roots = np.roots([v @ v, 2 * p @ v, p @ p - 0.25]) if v @ v > 1e-12 else np.zeros(0)
    real = roots[np.abs(roots.imag) < 1e-9].real
    times = np.clip(real, 0, 1)
    closest = p + v * np.clip(-(p @ v) / max(v @ v, 1e-300), 0, 1)
    gap = np.linalg.norm(closest) - 0.5
    if gap < -1e-7:
        truth = 0.0 if p @ p <= 0.25 else times.min()
        assert len(found) == 1
        # The time's error is that of the gap (1e-10) over the closing speed at contact.
        at = p + truth * v
        speed = abs(at @ v) / 0.5
        assert truth - 1e-8 - 1e-9 / max(speed, 1e-6) <= found.time[0] <= truth + 1e-9
        if np.linalg.norm(at) > 1e-3:
            assert found.normal[0] == pytest.approx(at / np.linalg.norm(at), abs=1e-4)
    elif gap > 1e-8:
        assert len(found) == 0


@given(st.floats(-0.5, 0.5), st.floats(0.3, 2), st.floats(-3, 3), st.floats(0, 3))
@settings(deadline=None, max_examples=100)
def test_a_turning_box_meets_the_plane_when_its_lowest_corner_does(tilt, height, drop, turn):
    model = scene(("plane", 'size="1 1 1"'), ("box", 'size=".1 .2 .05"'))
    half = np.array([0.1, 0.2, 0.05])

    def lowest(t):
        angle = tilt + t * turn  # about x
        reach = half[1] * np.abs(np.sin(angle)) + half[2] * np.abs(np.cos(angle))
        return height + t * drop - reach

    quat = [[np.cos(x / 2), np.sin(x / 2), 0, 0] for x in (tilt, tilt + turn)]
    before = np.array([0, 0, height, *quat[0]])
    after = np.array([0, 0, height + drop, *quat[1]])
    found = checker("rigid", model).check(*states(model, before, after))
    t = np.linspace(0, 1, 20001)
    below = lowest(t) < 0
    if below.any():
        first = t[np.argmax(below)]
        assert len(found) == 1
        assert first - 1e-4 <= found.time[0] <= first
        assert found.normal[0] == pytest.approx([0, 0, 1])
        if found.time[0] > 0:
            assert abs(lowest(found.time[0])) < 1e-9
    elif lowest(t).min() > 1e-6:
        assert len(found) == 0


@pytest.mark.parametrize(
    ("one", "other"), [p for p in itertools.combinations_with_replacement(SHAPES, 2)][:-1]
)
def test_no_pair_of_shapes_is_late_or_missed(one, other):
    """MuJoCo's own distance, sampled along the way, is the truth."""
    rest = {k: SHAPES[k] if k == "plane" else SHAPES[k] + ' pos=".02 0 .01"' for k in SHAPES}
    model = scene((one, rest[one]), (other, rest[other]))
    data = mujoco.MjData(model)
    rng = np.random.default_rng(3)
    check = checker("rigid", model)
    hits = 0
    for _ in range(12):
        start = rng.normal(size=model.nq) * 0.2
        start[:3] = [0, 0, 0.3] if "plane" in (one, other) else 0
        mujoco.mj_normalizeQuat(model, start)
        step = rng.normal(size=model.nv) * 0.4
        step[:3] = -start[:3] if "plane" in (one, other) else start[-7:-4]

        def pose(s, start=start, step=step):
            data.qpos[:] = start
            mujoco.mj_integratePos(model, data.qpos, step, s)
            mujoco.mj_kinematics(model, data)

        def distance(s, pose=pose):
            pose(s)
            return mujoco.mj_geomDistance(model, data, 0, 1, 10.0, np.zeros(6))

        pose(0)
        before = State.of(model, data)
        pose(1)
        found = check.check(before, State.of(model, data))
        times = np.linspace(0, 1, 60)
        d = np.array([distance(s) for s in times])
        # MuJoCo's distance is right to its ccd_tolerance (1e-6), and to 1e-4 in deep overlap.
        if d.min() < -1e-5:
            assert len(found) == 1
            assert found.time[0] <= times[np.argmax(d < -1e-5)]
            hits += 1
        # MuJoCo's capsule-box function knows no depth beyond the capsule's radius.
        deep = len(found) > 0 and found.time[0] == 0 and (one, other) == ("capsule", "box")
        if len(found) and not deep:
            assert abs(distance(found.time[0]) - found.distance[0]) < (
                2e-6 if found.time[0] > 0 else 1e-3
            )
        elif not len(found):
            assert d.min() > -1e-5
    assert hits >= 3


def test_fast_ball_through_a_thin_plate():
    model = scene(("sphere", 'size=".01"'), ("box", 'size="1 1 .001"'))
    before, after = poses([0.3, 0.2, 0.5], [0, 0, 0]), poses([0.3, 0.2, -1.5], [0, 0, 0])
    found = checker("rigid", model).check(*states(model, before, after))
    assert found.time == pytest.approx([(0.5 - 0.011) / 2], abs=1e-9)
    assert found.point[0] == pytest.approx([0.3, 0.2, 0.001], abs=1e-9)
    assert found.normal[0] == pytest.approx([0, 0, -1])
    assert found.distance == pytest.approx([0], abs=1e-9)
    assert [geom_kinds(model)[g] for g in found.geom[0]] == ["sphere", "box"]


def test_margin_and_gap_have_mujocos_meaning():
    model = scene(
        ("sphere", 'size=".1" margin=".02" gap=".03"'), ("sphere", 'size=".1" margin=".01"')
    )
    still = {}
    for d in (0.02, 0.05, 0.07):
        step = states(model, poses([0, 0, 0], [0, 0, 0.2 + d]), poses([0, 0, 0], [0, 0, 0.2 + d]))
        still[d] = {
            t: checker("rigid", model, threshold=t).check(*step)
            for t in ("surface", "margin", "gap")
        }
    listed = {d: {t for t in row if len(row[t])} for d, row in still.items()}
    assert listed == {0.02: {"margin", "gap"}, 0.05: {"gap"}, 0.07: set()}
    assert still[0.02]["margin"].distance == pytest.approx([0.02])


def test_resting_pairs_are_answered_from_the_step_before():
    model = scene(("plane", 'size="1 1 1"'), ("box", 'size=".1 .1 .1"'), ("sphere", 'size=".1"'))
    check = checker("rigid", model)
    rest = poses([0, 0, 0.099], [1, 0, 0.5])
    before, after = states(model, rest, rest)
    first = check.check(before, after)
    assert check.work.moved == 3
    again = check.check(before, after)
    assert (check.work.moved, check.work.reused) == (0, 3)
    np.testing.assert_array_equal(again.distance, first.distance)
    assert first.distance == pytest.approx([-0.001])
    moved = states(model, rest, poses([0, 0, 0.099], [1, 0, 0.05]))[1]
    assert len(check.check(after, moved)) == 2
    assert (check.work.moved, check.work.reused) == (1, 1)


def test_what_cannot_be_handled_is_named_at_construction():
    text = """<mujoco><asset><hfield name="h" nrow="3" ncol="3" size="1 1 1 1"/></asset><worldbody>
      <geom name="hills" type="hfield" hfield="h"/><body><freejoint/><geom size=".1"/></body>
      </worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    with pytest.raises(ValueError, match=r"geom 'hills' is a hfield; this checker handles plane"):
        checker("rigid", model)
    assert len(checker("rigid", model, skip=("hfield",)).pairs) == 0
    with pytest.raises(ValueError, match="'far': expected one of"):
        checker("rigid", model, threshold="far", skip=("hfield",))


@pytest.mark.parametrize("offset", [0.0, 1e3, 1e6])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e2])
def test_far_away_small_and_large(offset, scale):
    """The time's error grows with the distance from the origin, as doubles do, and no faster."""
    size = f'size="{0.1 * scale} {0.1 * scale} {0.1 * scale}"'
    for one, other in itertools.product(("box", "cylinder"), ("box", "ellipsoid", "capsule")):
        model = scene((one, size), (other, size))
        start = [offset, offset, offset + scale]
        height = 0.2 if other == "capsule" else 0.1
        end = [offset, offset, offset - 0.5 * scale]
        found = checker("rigid", model).check(
            *states(model, poses([offset] * 3, start), poses([offset] * 3, end))
        )
        way = (start[2] - offset, start[2] - end[2])
        truth = (way[0] - (0.1 + height) * scale) / way[1]
        rounding = 1e3 * 2.3e-16 * (offset / scale + 1)
        assert found.time == pytest.approx([truth], abs=1e-9 + rounding)
        assert abs(found.normal[0, 2]) == pytest.approx(1, abs=1e-6 + rounding)


def test_no_motion_and_exact_touch_and_the_same_centre():
    model = scene(("sphere", 'size=".5"'), ("box", 'size=".5 .5 .5"'))
    check = checker("rigid", model)
    for apart, touching in ((1.0, True), (1.0 + 1e-6, False), (0.0, True)):
        state = states(model, poses([0, 0, 0], [0, 0, apart]), poses([0, 0, 0], [0, 0, apart]))
        found = check.check(*state)
        assert (len(found) == 1) is touching
        if touching:
            assert found.time[0] == 0
            assert found.distance[0] == pytest.approx(apart - 1, abs=1e-9)
            assert np.linalg.norm(found.normal[0]) == pytest.approx(1)


def test_half_a_turn_in_one_step():
    """A rod swings through a post that it touches at neither end of the step."""
    model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody>
      <geom name="post" type="cylinder" size=".1 1" pos="0 .8 0"/>
      <body><joint axis="0 0 1"/><geom name="rod" type="capsule" fromto=".1 0 0 1 0 0"
      size=".05" mass="1"/></body></worldbody></mujoco>""")
    data = mujoco.MjData(model)
    before = State.of(model, data)
    data.qpos[0] = np.pi * (1 - 1e-9)
    found = checker("rigid", model).check(before, State.of(model, data))
    # The rod's side reaches the post's: sin(a) = (0.1 + 0.05) / 0.8 before the middle.
    truth = (np.pi / 2 - np.arcsin(0.15 / 0.8)) / np.pi
    assert found.time == pytest.approx([truth], abs=1e-8)
    assert len(checker("mujoco", model).check(before, State.of(model, data))) == 0


def test_a_state_that_does_not_fit_is_named():
    model = scene(("sphere", 'size=".1"'), ("sphere", 'size=".1"'))
    good = states(model, model.qpos0, model.qpos0)[0]
    xpos = good.xpos.copy()
    xpos[1, 2] = np.nan
    check = checker("rigid", model)
    with pytest.raises(ValueError, match=r"after.xpos: row 1 is .*not finite"):
        check.check(good, replace(good, xpos=xpos))
    with pytest.raises(ValueError, match=r"before.xmat: shape \(2, 9\), the model has \(3, 9\)"):
        check.check(replace(good, xmat=good.xmat[:2]), good)


def test_the_point_of_boxes_in_each_other_is_the_middle_of_their_overlap():
    # The kernel's own distance, certified on exact arithmetic, is the truth.
    rng, half = np.random.default_rng(9), np.array([[0.1, 0.07, 0.05]])
    model = scene(("box", SHAPES["box"]), ("box", SHAPES["box"]))
    rigid, seen = checker("rigid", model), 0
    for _ in range(200):
        quat = rng.normal(size=(2, 4))
        at = np.concatenate([[*rng.uniform(-0.06, 0.06, 3), *q / np.linalg.norm(q)] for q in quat])
        here, there = states(model, at, at + 1e-6)
        found = rigid.check(here, there)
        bodies = [
            Boxes(here.geom_xpos[[g]], half, here.geom_xmat[g].reshape(1, 3, 3)) for g in (0, 1)
        ]
        truth = distance(*bodies)
        if truth.distance[0] > -1e-4:
            continue
        assert found.distance[0] == pytest.approx(truth.distance[0], abs=1e-12)
        middle = 0.5 * (truth.point_a + truth.point_b)[0]
        np.testing.assert_allclose(found.point[0], middle, atol=1e-6)
        seen += 1
    assert seen > 100
