"""The cloth checker against closed forms and against MuJoCo's own contacts at rest."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.contacts import State, checker, contacts_of
from tauguard.contacts.scenes import ball_cloth

RADIUS = 1e-3


def sheet(name="sheet", count=5, spacing=0.1, where="0 0 0", own="none", pin="", more=""):
    return f"""<flexcomp name="{name}" type="grid" dim="2" count="{count} {count} 1" mass=".1"
      spacing="{spacing} {spacing} {spacing}" pos="{where}" radius="{RADIUS}">{pin}
      <contact selfcollide="{own}" {more}/><edge equality="true"/></flexcomp>"""


def model_of(body):
    return mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{body}</worldbody></mujoco>")


BALL = '<body><freejoint/><geom size=".01" mass=".02"/></body>'


@given(
    st.floats(-0.15, 0.15),
    st.floats(-0.15, 0.15),
    st.floats(0.02, 0.2),
    st.floats(0.0, 0.4),
    st.sampled_from([1.0, -1.0]),
)
@settings(deadline=None, max_examples=100)
def test_a_ball_meets_flat_cloth_after_the_way_that_is_left(x, y, height, travel, side):
    model = model_of(BALL + sheet())
    data = mujoco.MjData(model)
    data.qpos[:3] = x, y, side * height
    before = State.of(model, data)
    data.qpos[2] -= side * travel
    found = checker("cloth", model).check(before, State.of(model, data))
    left = height - 0.01 - RADIUS
    if travel > left + 1e-9:
        # Shapes closer than 1e-10 of their size (below 0.2 m here) touch.
        assert found.time.min() == pytest.approx(left / travel, abs=1e-9 + 0.2e-10 / travel)
        first = np.argmin(found.time)
        # A neighbour beyond the edge may be as early to 1e-9 and lean by the root of that.
        assert found.normal[first] == pytest.approx([0, 0, -side], abs=1e-3)
        assert found.point[first] == pytest.approx([x, y, side * RADIUS], abs=1e-6)
        assert found.geom.tolist() == [[0, -1]] * len(found)
        assert found.flex.tolist() == [[-1, 0]] * len(found)
    elif travel < left - 1e-8:
        assert len(found) == 0


@pytest.mark.parametrize("timestep", [1e-3, 5e-3])
@pytest.mark.parametrize("speed", [1.0, 10.0, 50.0])
def test_every_crossing_of_the_ball_is_timed(speed, timestep):
    """The ball flies freely and fast at cloth at rest: its time of impact is known."""
    scene = ball_cloth()
    model = scene.model
    data = mujoco.MjData(model)
    data.qpos[:] = scene.qpos
    rest = State.of(model, data)
    ball = model.geom_bodyid[0]
    normal = np.array([0, 0, 1.0])
    heights = (rest.flexvert_xpos - rest.xpos[ball]) @ normal
    if np.ptp(heights) > 1e-9:  # the cloth stands upright: it faces another axis
        spread = [np.ptp((rest.flexvert_xpos - rest.xpos[ball])[:, k]) for k in range(3)]
        normal = np.eye(3)[np.argmin(spread)]
        heights = (rest.flexvert_xpos - rest.xpos[ball]) @ normal
    gap = abs(heights[0]) - model.geom_size[0, 0] - model.flex_radius[0]
    check = checker("cloth", model)
    step = speed * timestep
    for offset in np.linspace(0.02, 0.98, 7):
        toward = np.sign(heights[0]) * normal
        start = rest.xpos[ball] + toward * (gap - offset * step)
        a, b = rest.xpos.copy(), rest.xpos.copy()
        a[ball], b[ball] = start, start + toward * step
        before, after = (
            State(0, rest.qpos, rest.qvel, x, rest.xmat, rest.geom_xpos, rest.geom_xmat, v)
            for x, v in ((a, rest.flexvert_xpos), (b, rest.flexvert_xpos))
        )
        found = check.check(before, after)
        assert len(found)
        assert found.time.min() == pytest.approx(offset, abs=1e-6)


@pytest.mark.parametrize("shape", ["sphere", "capsule", "box", "cylinder", "ellipsoid", "mesh"])
def test_at_rest_the_contacts_are_mujocos(shape):
    """Triangles that MuJoCo finds in contact, and how deep, for every kind of geom."""
    size = 'mesh="rock"' if shape == "mesh" else 'size=".07 .06 .05"'
    points = np.random.default_rng(5).normal(size=(30, 3)) * 0.05
    text = f"""<mujoco><asset><mesh name="rock" vertex="{" ".join(map(str, points.ravel()))}"/>
      </asset><worldbody><body><freejoint/><geom type="{shape}" {size} mass="1"/></body>
      {sheet(count=7)}</worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    rng = np.random.default_rng(2)
    check = checker("cloth", model)
    contacts = 0
    for _ in range(20):
        data.qpos[:] = rng.normal(size=model.nq) * 0.01
        data.qpos[:7] = *(rng.uniform(-0.3, 0.3, 2)), rng.uniform(-0.1, 0.1), *rng.normal(size=4)
        mujoco.mj_normalizeQuat(model, data.qpos)
        mujoco.mj_forward(model, data)
        state = State.of(model, data)
        found = check.check(state, state)
        theirs = contacts_of(data)
        mine = dict(zip(found.feature[:, 1].tolist(), found.distance, strict=True))
        for element, distance in zip(theirs.feature[:, 1].tolist(), theirs.distance, strict=True):
            if distance < -1e-6:
                assert element in mine
                contacts += 1
            # Shallow contacts have one distance; the middle surface is then outside the geom.
            if -RADIUS < mine.get(element, -1) < 0 and shape in ("sphere", "capsule"):
                assert mine[element] <= distance + 1e-6
    assert contacts > 20


def test_triangles_that_hang_on_the_geoms_body_are_left_out():
    body = (
        '<body name="hand"><freejoint/><geom size=".1"/>'
        '<flexcomp name="s" type="grid" dim="2" count="3 3 1" spacing=".05 .05 .05" mass=".1" '
        'radius=".001"><pin id="4"/><edge equality="true"/></flexcomp></body>'
    )
    model = model_of(body)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    state = State.of(model, data)
    found = checker("cloth", model).check(state, state)
    theirs = contacts_of(data)
    assert set(found.feature[:, 1].tolist()) == set(theirs.feature[:, 1].tolist())
    centre = np.argmin(np.linalg.norm(state.flexvert_xpos, axis=1))
    held = (model.flex_elem.reshape(-1, 3) == centre).any(axis=1)
    assert held.any()
    assert not held[found.feature[:, 1]].any()


def test_folded_cloth_touches_itself_where_mujoco_says():
    model = model_of(sheet(count=8, spacing=0.05, own="auto"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    rest = State.of(model, data)
    x = rest.flexvert_xpos.copy()
    rng = np.random.default_rng(0)
    folded = x[:, 0] > 0.02
    x[folded, 0] *= -1
    x[folded, 2] += 0.5 * RADIUS + rng.uniform(-1, 1, folded.sum()) * RADIUS
    data.qpos[:] = (x - rest.flexvert_xpos).ravel()
    mujoco.mj_forward(model, data)
    state = State.of(model, data)
    np.testing.assert_allclose(state.flexvert_xpos, x, atol=1e-12)
    found = checker("cloth", model).check(state, state)
    mine = {tuple(sorted(pair)) for pair in found.feature.tolist()}
    theirs = contacts_of(data)
    touching = theirs.feature[theirs.distance < -1e-6]
    assert len(touching) >= 20
    assert {tuple(sorted(pair)) for pair in touching.tolist()} <= mine


def test_sheets_that_pass_through_one_another_in_a_step():
    model = model_of(sheet("a", own="auto") + sheet("b", where=".03 .02 .1", own="auto"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    before = State.of(model, data)
    x = before.flexvert_xpos.copy()
    upper = x[:, 2] > 0.05
    x[upper, 2] -= 0.3
    data.qpos[:] = (x - before.flexvert_xpos).ravel()
    after = State.of(model, data)
    found = checker("cloth", model).check(before, after)
    assert found.flex.tolist() == [[0, 1]] * len(found)
    assert found.time == pytest.approx((0.1 - 2 * RADIUS) / 0.3, abs=1e-9)
    assert np.abs(found.normal[:, 2]) == pytest.approx(1)
    assert len(checker("mujoco", model).check(before, after)) == 0
    assert len(checker("cloth", model, self_collision=False).check(before, after)) == 0


def test_margin_counts_between_cloth_and_geom():
    model = model_of(BALL + sheet(more='margin=".02" gap=".03"'))
    data = mujoco.MjData(model)
    listed = {}
    for gap in (0.01, 0.03, 0.06):
        data.qpos[2] = 0.01 + RADIUS + gap
        state = State.of(model, data)
        for threshold in ("surface", "margin", "gap"):
            found = checker("cloth", model, threshold=threshold).check(state, state)
            listed[gap, threshold] = len(found) > 0
            if len(found):
                assert found.distance.min() == pytest.approx(gap)
    assert [k for k, v in listed.items() if v] == [
        (0.01, "margin"),
        (0.01, "gap"),
        (0.03, "gap"),
    ]


def test_what_cannot_be_handled_is_named_at_construction():
    cable = (
        '<flexcomp name="rope" type="grid" dim="1" count="5 1 1" spacing=".1 .1 .1" mass=".1" '
        'radius=".01"><edge equality="true"/></flexcomp>'
    )
    with pytest.raises(ValueError, match=r"flex 'rope' has dimension 1; this checker handles 2"):
        checker("cloth", model_of(BALL + cable))
    text = (
        """<mujoco><asset><hfield name="h" nrow="3" ncol="3" size="1 1 1 1"/></asset><worldbody>
      <geom name="hills" type="hfield" hfield="h"/>"""
        + sheet()
        + "</worldbody></mujoco>"
    )
    model = mujoco.MjModel.from_xml_string(text)
    with pytest.raises(ValueError, match=r"cloth: geom 'hills' is a hfield"):
        checker("cloth", model)
    assert len(checker("cloth", model, skip=("hfield",)).check(*[_state(model)] * 2)) == 0


def _state(model):
    return State.of(model, mujoco.MjData(model))


@pytest.mark.parametrize("geom", ['type="capsule" size=".02 .2"', 'type="box" size=".02 .02 .2"'])
def test_a_bar_across_the_middle_of_triangles_is_seen_where_mujoco_lists_nothing(geom):
    """MuJoCo's own capsules and boxes can lie within a triangle's thickness without a contact."""
    bar = f'<body euler="0 90 0"><freejoint/><geom {geom} mass="1"/></body>'
    model = model_of(bar + sheet(spacing=0.1))
    data, rng, missed = mujoco.MjData(model), np.random.default_rng(0), 0
    cloth, scratch = checker("cloth", model), mujoco.MjData(model)
    weights = np.array([(i, j, 20 - i - j) for i in range(21) for j in range(21 - i)]) / 20
    for _ in range(120):
        data.qpos[:] = model.qpos0
        data.qpos[:3] = *rng.uniform(-0.1, 0.1, 2), rng.uniform(0.016, 0.0209)
        data.qpos[7:] = rng.uniform(-0.003, 0.003, model.nq - 7)
        turn = rng.uniform(0, np.pi)  # about z, of a bar that lies along x
        data.qpos[3:7] = np.array([np.cos(turn / 2), 0, 0, np.sin(turn / 2)])
        mujoco.mju_mulQuat(data.qpos[3:7], data.qpos[3:7].copy(), model.qpos0[3:7])
        mujoco.mj_forward(model, data)
        state = State.of(model, data, scratch)
        found = cloth.check(state, state)
        points = (weights @ state.flexvert_xpos[model.flex_elem.reshape(-1, 3)]).reshape(-1, 3)
        local = (points - state.geom_xpos[0]) @ state.geom_xmat[0].reshape(3, 3)
        inside = np.abs(local) - [0.02, 0.02, 0.2]  # sampled: never nearer than the truth
        if "capsule" in geom:
            along = np.clip(local[:, 2], -0.2, 0.2)
            depth = np.linalg.norm(local - along[:, None] * [0, 0, 1], axis=1) - 0.02
        else:
            depth = np.linalg.norm(np.maximum(inside, 0), axis=1)
        if depth.min() < RADIUS:
            assert len(found)
            missed += data.ncon == 0
    assert missed > 2
