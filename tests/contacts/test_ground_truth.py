"""The ground truth against closed forms, coal, dense samples and MuJoCo's own choice of pairs."""

import coal
import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.contacts import State
from tauguard.contacts.ground_truth import Event, GroundTruth, Touches, events
from tauguard.contacts.ground_truth import triangles as tri
from tauguard.contacts.ground_truth.touches import geom_pairs, search
from tauguard.contacts.scenes import ball_cloth, sphere_plate

SHAPES = {
    "sphere": 'size=".1"',
    "capsule": 'size=".07 .2"',
    "ellipsoid": 'size=".1 .15 .2"',
    "cylinder": 'size=".1 .15"',
    "box": 'size=".1 .15 .2"',
    "mesh": 'mesh="m"',
}


def free_bodies(*kinds, extra=""):
    mesh = "0 0 .2  .1 0 -.1  -.1 .1 -.1  -.1 -.1 -.1  0 .1 .05"
    bodies = "".join(
        f'<body><freejoint/><geom type="{kind}" {SHAPES[kind]}/></body>' for kind in kinds
    )
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><asset><mesh name="m" vertex="{mesh}"/></asset>'
        f"<worldbody>{bodies}{extra}</worldbody></mujoco>"
    )


def state(model, qpos):
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    return State.of(model, data)


def pose(place, rotvec=(0, 0, 0)):
    quat, angle = np.array([1.0, 0, 0, 0]), np.linalg.norm(rotvec)
    if angle > 0:
        mujoco.mju_axisAngle2Quat(quat, np.asarray(rotvec) / angle, angle)
    return [*place, *quat]


@pytest.mark.parametrize("speed", [1.0, 50.0])
@pytest.mark.parametrize("impact", ["vertex", "edge", "face"])
def test_a_ball_in_free_flight_touches_the_cloth_when_the_formula_says(speed, impact):
    """Gap 5 mm plus 3 mm at constant speed; the cloth rests."""
    scene = ball_cloth(speed, offset=0.003, impact=impact)
    model, data = scene.start()
    before = State.of(model, data)
    flight = 2 * (0.005 + 0.003) / speed
    data.qpos[-5] -= speed * flight
    verdict = GroundTruth(model).touches(before, State.of(model, data))
    assert len(verdict) == 1
    assert verdict.counts.all()
    assert verdict.flex.tolist() == [[-1, 0]]
    assert verdict.time[0] * flight == pytest.approx(0.008 / speed, abs=1e-9)


def test_a_sphere_through_a_thin_plate_is_seen_within_one_step():
    scene = sphere_plate(speed=1000.0)
    model, data = scene.start()
    before = State.of(model, data)
    data.qpos[2] -= 1.0
    verdict = GroundTruth(model).touches(before, State.of(model, data))
    assert verdict.time[0] == pytest.approx(0.005, abs=1e-8)


def test_a_turning_capsule_meets_a_sphere_at_the_analytic_angle():
    """A rod of 0.2 half-length turns about z; the ball's surface is sin(angle) * 0.15 away."""
    model = free_bodies("capsule", "sphere")
    ball = [0.15, 0.25, 0.0]
    flat = np.array([0.5**0.5, 0, 0.5**0.5, 0])  # the capsule's z axis along x
    turned = np.zeros(4)
    mujoco.mju_mulQuat(turned, np.array([np.cos(0.6), 0, 0, np.sin(0.6)]), flat)
    start = [0, 0, 0, *flat, *pose(ball)]
    end = [0, 0, 0, *turned, *pose(ball)]
    verdict = GroundTruth(model).touches(state(model, start), state(model, end))
    # The ball's centre to the rod's axis at angle a, less both radii.
    angle = np.linspace(0, 1.2, 2_000_001)
    along = np.clip(0.15 * np.cos(angle) + 0.25 * np.sin(angle), -0.2, 0.2)
    apart = np.hypot(0.15 - along * np.cos(angle), 0.25 - along * np.sin(angle)) - 0.17
    assert verdict.time[0] * 1.2 == pytest.approx(angle[np.argmax(apart <= 0)], abs=2e-6)


@given(st.integers(0, 2**32 - 1), st.sampled_from(list(SHAPES)), st.sampled_from(list(SHAPES)))
@settings(max_examples=60, deadline=None)
def test_what_dense_samples_see_the_ground_truth_has(seed, first, second):
    rng = np.random.default_rng(seed)
    model = free_bodies(first, second)
    ends = [
        np.concatenate([pose(rng.normal(size=3) * 0.4, rng.normal(size=3)) for _ in range(2)])
        for _ in range(2)
    ]
    states = [state(model, q) for q in ends]
    verdict = GroundTruth(model).touches(*states)
    data, depth, first_s = mujoco.MjData(model), 0.0, np.inf
    vel = np.zeros(model.nv)
    mujoco.mj_differentiatePos(model, vel, 1.0, *ends)
    for s in np.linspace(0, 1, 201):
        data.qpos[:] = ends[0]
        mujoco.mj_integratePos(model, data.qpos, vel, s)
        mujoco.mj_kinematics(model, data)
        d = mujoco.mj_geomDistance(model, data, 0, 1, 10, None)
        if d < 0:
            depth, first_s = max(depth, -d), min(first_s, s)
    if depth > 2e-5:
        assert len(verdict) == 1
        assert verdict.counts[0]
        assert verdict.time[0] <= first_s + 1e-6
    if len(verdict):
        assert verdict.time[0] <= first_s
        assert first_s - verdict.time[0] < 0.0051 or not np.isfinite(first_s) or depth < 0.01


@pytest.mark.parametrize(
    ("gap", "rows", "counts"), [(1e-4, 0, None), (-5e-6, 1, False), (-2e-5, 1, True)]
)
def test_a_graze_below_the_tolerance_does_not_count(gap, rows, counts):
    """A ball passes another at a closest distance of ``gap`` in the middle of the step."""
    model = free_bodies("sphere", "sphere")
    apart = 0.2 + gap
    verdict = GroundTruth(model).touches(
        state(model, [*pose([-0.3, apart, 0]), *pose([0, 0, 0])]),
        state(model, [*pose([0.3, apart, 0]), *pose([0, 0, 0])]),
    )
    assert len(verdict) == rows
    if rows:
        assert verdict.counts[0] == counts
        then = np.hypot(0.6 * verdict.time[0] - 0.3, apart) - 0.2
        assert abs(then) < 3e-6
        assert verdict.time[0] < 0.5


@pytest.mark.parametrize("seed", range(5))
def test_triangle_distances_against_coal(seed):
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(200, 3, 3)) * 0.3
    ends = rng.normal(size=(2, 200, 3)) * 0.4
    corners[:20, 2] = corners[:20, 1]  # an edge
    ends[1, 20:40] = ends[0, 20:40]  # a point
    ours = tri.segment_triangle(*ends, corners)
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    for k in range(200):
        shapes = []
        for points in (corners[k], ends[:, k]):
            cloud, faces = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
            for point in points[[0, 1, -1]]:
                cloud.append(point)
            faces.append(coal.Triangle(0, 1, 2))
            shapes += [coal.Convex(cloud, faces), coal.Transform3s.Identity()]
        result.clear()
        theirs = max(coal.distance(*shapes, request, result), 0.0)
        assert ours[k] == pytest.approx(theirs, abs=2e-6)


@pytest.mark.parametrize("kind", ["box", "cylinder", "ellipsoid", "mesh"])
def test_a_sheet_meets_every_kind_of_geom(kind):
    """The geom falls onto a flat sheet; its lowest point is known from its support."""
    model = mujoco.MjModel.from_xml_string(f"""<mujoco><asset>
      <mesh name="m" vertex="0 0 -.2  .1 0 .1  -.1 .1 .1  -.1 -.1 .1"/></asset><worldbody>
      <body name="b"><freejoint/><geom type="{kind}" {SHAPES[kind]}/></body>
      <flexcomp name="f" type="grid" dim="2" count="5 5 1" spacing=".2 .2 .2" radius=".001">
      <edge equality="true"/><contact selfcollide="none"/><pin id="0"/></flexcomp>
      </worldbody></mujoco>""")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    if kind == "mesh":
        placed = model.mesh_vert @ data.geom_xmat[0].reshape(3, 3).T + data.geom_xpos[0]
        lowest = placed[:, 2].min()
    else:
        lowest = -model.geom_size[0][1 if kind == "cylinder" else 2]
    data.qpos[2] += 0.001 - lowest + 0.05
    before = State.of(model, data)
    data.qpos[2] -= 0.4
    verdict = GroundTruth(model).touches(before, State.of(model, data))
    assert verdict.geom.tolist() == [[0, -1]]
    assert verdict.time[0] * 0.4 == pytest.approx(0.05, abs=3e-6)


def test_pairs_are_those_that_mujoco_makes():
    """Everything in one place: whatever may touch, does."""
    model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody>
      <geom size="1"/><geom size="1" contype="4" conaffinity="0"/>
      <body name="a"><geom size="1"/><geom size="1" contype="2" conaffinity="2"/><freejoint/>
        <body name="b"><joint/><geom size="1"/>
          <body name="welded"><geom size="1" contype="0" conaffinity="7"/></body>
          <body name="c"><joint axis="1 0 0"/><geom name="c" size="1"/></body></body></body>
      <body name="d"><freejoint/><geom name="d" size="1"/></body>
      <body name="e"><freejoint/><geom name="e" size="1" contype="0" conaffinity="0"/></body>
      </worldbody><contact><exclude body1="a" body2="d"/><pair geom1="c" geom2="e"/></contact>
      </mujoco>""")
    data = mujoco.MjData(model)
    for body in range(1, model.nbody):
        model.body_pos[body] = [0.01 * body, 0.02 * body, 0]
    data.qpos[:] = 0.01 * np.arange(model.nq)
    mujoco.mj_forward(model, data)
    theirs = {tuple(sorted(map(int, contact.geom))) for contact in data.contact}
    assert {tuple(map(int, pair)) for pair in geom_pairs(model)} == theirs
    assert len(theirs) > 5


def test_the_search_does_not_miss_a_short_dip():
    """A dip of 1e-4 of the step between any regular samples, as the bound allows."""
    where, slope = 0.123456789, 3.0

    def distance(rows, s):
        return slope * (np.abs(s - where) - 5e-5)

    found = search(distance, np.array([slope]))
    assert found.time[0] == pytest.approx(where - 5e-5, abs=1e-9)
    assert found.depth[0] > 1e-5


def touches_of(*rows):
    return Touches(
        np.array([[0, 1]] * len(rows)).reshape(-1, 2),
        np.full((len(rows), 2), -1),
        np.array([r[0] for r in rows]),
        np.array([r[1] for r in rows]),
        np.array([r[1] > 1e-5 for r in rows], dtype=bool),
    )


def test_short_gaps_are_one_event_and_long_ones_two():
    model = free_bodies("sphere", "sphere")
    steps = [
        touches_of((0.5, 1e-3)),
        *[touches_of()] * 4,
        touches_of((0.0, 2e-3)),
        *[touches_of()] * 9,
    ]
    steps.append(touches_of((0.25, 5e-6)))
    times = [1e-3 * k for k in range(len(steps) + 1)]
    found = events(model, times, steps)
    pair = (("body", 1), ("body", 2))
    assert [e.pair for e in found] == [pair, pair]
    assert [e.counts for e in found] == [True, False]
    assert found[0].onset == pytest.approx(0.5e-3)
    assert found[0].end == pytest.approx(6e-3)
    assert found[0].depth == 2e-3
    assert found[1].onset == pytest.approx(15.25e-3)
    assert found[0].seen([7e-3], 1e-3)
    assert not found[0].seen([7.1e-3], 1e-3)
    assert not Event(pair, 1.0, 1.1, 0.0, True).seen([], 1e-3)
    with pytest.raises(ValueError, match="one more than touches"):
        events(model, times[:-1], steps)


def test_a_flex_that_it_cannot_judge_is_named():
    model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody>
      <geom size="1"/><flexcomp name="rope" type="grid" dim="1" count="5 1 1" spacing=".2 .2 .2">
      <edge equality="true"/><pin id="0"/></flexcomp></worldbody></mujoco>""")
    with pytest.raises(ValueError, match=r"rope.*dim 1"):
        GroundTruth(model)
