"""Bodies that mocap poses move: what they meet is pushed or stopped, or the pair is named."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.contacts import GuardedStepper
from tauguard.contacts.guard.mocap import pulled

GEOMS = {
    "ball": 'type="sphere" size=".02"',
    "box": 'type="box" size=".02 .01 .03"',
    "rod": 'type="capsule" size=".006 .04"',
}


def scene(timestep, ball=GEOMS["ball"], world="", hang="", extra=""):
    """A paddle 2 mm thick, 20 cm before a free body of 50 g; no gravity."""
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>
      <option timestep="{timestep}" integrator="implicitfast" gravity="0 0 0"/><worldbody>
      <body name="pad" mocap="true" pos="-.2 0 0"><geom name="pad" type="box" size=".001 .2 .2"/>
      {hang}</body>{world}
      <body name="ball"><freejoint/><geom name="ball" {ball} mass=".05"/></body>
      </worldbody>{extra}</mujoco>""")
    return model, mujoco.MjData(model)


@pytest.mark.parametrize("timestep", [5e-4, 2e-3, 1e-2])
@pytest.mark.parametrize(("ball", "speed"), [("ball", 1), ("ball", 30), ("box", 10), ("rod", 20)])
def test_a_paddle_takes_a_free_body_along(ball, speed, timestep):
    model, data = scene(timestep, GEOMS[ball])
    guard, added = GuardedStepper(model, data), 0.0
    elastic = 0.5 * 0.05 * (2 * speed) ** 2  # what an elastic impact gives [J]
    while data.mocap_pos[0, 0] < 0.5:
        data.mocap_pos[0, 0] += speed * timestep
        commanded = data.mocap_pos.copy()
        report = guard.step()
        assert not report.exhausted
        np.testing.assert_array_equal(data.mocap_pos, commanded)
        assert data.qpos[0] > commanded[0, 0]
        assert 0.5 * 0.05 * (data.qvel[:3] ** 2).sum() <= 1.02 * elastic
        added += report.energy_added
    assert added <= 0.01 * elastic  # beyond the work of the paddle
    assert data.qvel[0] > 0.9 * speed or data.qpos[0] > 0.6


def test_plain_steps_lose_it():
    model, data = scene(2e-3)
    while data.mocap_pos[0, 0] < 0.5:
        data.mocap_pos[0, 0] += 30 * 2e-3
        mujoco.mj_step(model, data)
    assert data.qpos[0] < data.mocap_pos[0, 0]


@pytest.mark.parametrize(("stop", "lost"), [(0.26, False), (0.4, True)])
def test_between_a_paddle_and_a_wall_the_body_stays_or_the_pair_is_named(stop, lost):
    model, data = scene(1e-3, world='<geom name="wall" type="box" pos=".3 0 0" size=".001 .3 .3"/>')
    guard, passed = GuardedStepper(model, data), set()
    while data.mocap_pos[0, 0] < stop:
        data.mocap_pos[0, 0] += 5e-3
        report = guard.step()
        passed |= set(report.passed)
        if not report.exhausted and not passed:
            assert data.mocap_pos[0, 0] < data.qpos[0] < 0.3
    ball = model.geom("ball").id
    assert bool(passed) == lost
    assert all(("geom", ball) in pair for pair in passed)


@pytest.mark.parametrize("timestep", [1e-3, 5e-3])
def test_a_paddle_that_swings_by_its_quaternion_takes_a_ball_along(timestep):
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>
      <option timestep="{timestep}" gravity="0 0 0"/><worldbody><body name="pad" mocap="true">
      <geom name="pad" type="box" pos=".3 0 0" size=".2 .001 .2"/></body><body pos=".3 .1 0">
      <freejoint/><geom name="ball" size=".02" mass=".1"/></body></worldbody></mujoco>""")
    data = mujoco.MjData(model)
    guard, angle = GuardedStepper(model, data), 0.0
    while angle < 1.2:
        angle += 60 * timestep
        mujoco.mju_axisAngle2Quat(data.mocap_quat[0], [0, 0, 1], angle)
        assert not guard.step().exhausted
        assert np.cos(angle) * data.qpos[1] - np.sin(angle) * data.qpos[0] > 0
    assert np.linalg.norm(data.qvel[:3]) > 10


def test_a_finger_that_hangs_on_a_mocap_body_pushes_too():
    model, data = scene(
        2e-3,
        hang="""<body pos="0 0 .3"><joint axis="0 1 0" stiffness="50" damping="1"/>
          <geom type="box" pos=".05 0 -.2" size=".001 .1 .2" mass=".5"/></body>""",
    )
    guard, finger = GuardedStepper(model, data), model.ngeom - 2
    for _ in range(40):
        data.mocap_pos[0, 0] += 0.02
        assert not guard.step().exhausted
        mujoco.mj_kinematics(model, data)
        normal = data.geom_xmat[finger].reshape(3, 3)[:, 0]
        assert normal @ (data.qpos[-7:-4] - data.geom_xpos[finger]) > 0
        assert data.qpos[-7] > data.mocap_pos[0, 0]


@pytest.mark.parametrize("thick", [5e-4, 5e-3])
def test_a_gripper_welded_to_mocap_follows_it_and_pushes_what_is_in_its_way(thick):
    model, data = scene(
        2e-3,
        world=f"""<body name="grip" pos="-.1 0 0"><freejoint/><geom name="grip" type="box"
          size="{thick} .1 .1" mass="1"/></body>""",
        extra="""<contact><exclude body1="pad" body2="grip"/></contact>
          <equality><weld body1="pad" body2="grip"/></equality>""",
    )
    guard, free = GuardedStepper(model, data), mujoco.MjData(model)
    free.qpos[7] = 5  # the ball is far away
    for _ in range(40):
        for d in (data, free):
            d.mocap_pos[0, 0] += 0.01
        assert not guard.step().exhausted
        mujoco.mj_step(model, free)
        assert data.qpos[0] < data.qpos[7]
    assert abs(data.qpos[0] - free.qpos[0]) < 0.03


@pytest.mark.parametrize(
    ("flag", "beside", "expected"),
    [
        ('dim="2" count="4 4 1"><edge equality="true"/><pin id="0 1"/>', "", [1]),
        ("", 'dim="2" count="4 4 1"><edge equality="true"/>', [0]),
        ("", 'dim="3" count="3 3 3" dof="trilinear"><edge equality="strain"/>', [0]),
    ],
)
def test_equalities_of_a_flag_on_a_mocap_pole_count_as_pulled_and_others_do_not(
    flag, beside, expected
):
    def flex(text):
        return (
            text
            and f"""<flexcomp name="flag" type="grid" spacing=".1 .1 .1" mass="1" {text}
          <contact selfcollide="none"/></flexcomp>"""
        )

    pole = '<body name="pole" mocap="true"><geom size=".01"/>'
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody>{flex(beside)}{pole}{flex(flag)}</body></worldbody></mujoco>"
    )
    assert pulled(model).tolist() == expected


def test_put_somewhere_else_nothing_is_on_the_way():
    """After ``reset`` and where the time is set back; else the way counts."""
    model, data = scene(2e-3)
    guard = GuardedStepper(model, data)
    data.mocap_pos[0, 0] = 0.2
    guard.reset()
    assert guard.step().steps == 1
    mujoco.mj_resetData(model, data)
    data.mocap_pos[0, 0] = 0.2
    assert guard.step().steps == 1
    assert data.qpos[0] == 0
    data.mocap_pos[0, 0] = -0.2
    assert guard.step().steps > 1
    assert data.qpos[0] < -0.2


@settings(max_examples=25, deadline=None)
@given(
    st.lists(st.floats(-0.02, 0.02), min_size=3, max_size=3),
    st.lists(st.floats(-1, 1), min_size=4, max_size=4),
)
def test_a_paddle_that_meets_nothing_changes_no_bit(way, quat):
    model, data = scene(2e-3)
    twin = mujoco.MjData(model)
    for d in (data, twin):
        d.qpos[0], d.qvel[:] = 5, [1, 2, 3, 4, 5, 6]
    guard = GuardedStepper(model, data)
    for _ in range(5):
        for d in (data, twin):
            d.mocap_pos[0] += way
            d.mocap_quat[0] = quat
        assert guard.step().steps == 1
        mujoco.mj_step(model, twin)
    for name in ("qpos", "qvel", "mocap_pos", "mocap_quat", "xpos", "time"):
        np.testing.assert_array_equal(getattr(data, name), getattr(twin, name))


@pytest.mark.parametrize("turn", [0.1, 0.5])
def test_a_plane_that_turns_takes_a_cloth_along(turn):
    """The plane turns about its own origin: its way grows with the distance of what it meets."""
    model = mujoco.MjModel.from_xml_string("""<mujoco><option timestep=".002" gravity="0 0 0"/>
        <worldbody><body mocap="true"><geom type="plane" size="1 1 .1"/></body>
        <flexcomp name="cloth" type="grid" dim="2" count="3 3 1" spacing=".02 .02 .02"
            pos=".4 0 .02" radius=".002" mass=".05"><contact selfcollide="none"/>
          <edge equality="true"/></flexcomp></worldbody></mujoco>""")
    data = mujoco.MjData(model)
    guard = GuardedStepper(model, data)
    guard.step()
    data.mocap_quat[0] = [np.cos(turn / 2), 0, -np.sin(turn / 2), 0]
    first, second = guard.step(), guard.step()
    assert first.cuts
    assert not first.passed
    assert not second.passed
    assert (data.flexvert_xpos @ [-np.sin(turn), 0, np.cos(turn)] > 0).all()


@pytest.mark.parametrize("speed", [1.0, 5.0])
def test_a_ball_between_a_paddle_and_a_table_leaves_no_faster_than_an_elastic_impact(speed):
    """It has to slide on one of them: by MuJoCo's friction it would leave 5 times as fast."""
    model = mujoco.MjModel.from_xml_string("""<mujoco><option timestep=".002"/><worldbody>
        <geom type="box" size="1 .5 .02" pos="0 0 -.02"/>
        <body pos="0 0 .02"><freejoint/><geom size=".02" mass=".05"/></body>
        <body mocap="true" pos="-.1 0 .06"><geom type="box" size=".005 .2 .05"/></body>
        </worldbody></mujoco>""")
    data = mujoco.MjData(model)
    guard = GuardedStepper(model, data)
    fastest, place = 0.0, -0.1
    while place < 0.1:
        place += speed * 2e-3
        data.mocap_pos[0, 0] = place
        guard.step()
        fastest = max(fastest, float(np.linalg.norm(data.qvel[:3])))
        assert data.qpos[0] > place
    # Beside the impact, a fifth of the depth that plain steps left, at most half the paddle's
    # 10 mm, may be pushed out in a step.
    assert speed <= fastest <= 2 * speed + 0.2 * 0.005 / 2e-3
