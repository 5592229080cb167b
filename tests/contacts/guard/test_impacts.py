"""Impacts in which the guard acts are inelastic, with Coulomb friction: nothing is thrown up."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.contacts import GuardedStepper

CONES, INTEGRATORS = ("pyramidal", "elliptic"), ("Euler", "implicitfast", "implicit", "discrete")
#: Shapes that fall flat, or balls: an impact turns no spin into lift.
SHAPES = {
    "box": 'type="box" size=".02 .02 .002"',
    "disc": 'type="cylinder" size=".02 .003"',
    "ball": 'size=".01"',
    "mesh": 'type="mesh" mesh="prism"',
}
FLOORS = {
    "plate": '<geom type="box" size="50 50 .002" pos="0 0 -.002"/>',
    "plane": '<geom type="plane" size="50 50 .1"/>',
}
PRISM = """<asset><mesh name="prism" vertex="-.02 -.01 -.003 .02 -.01 -.003 0 .02 -.003
  -.02 -.01 .003 .02 -.01 .003 0 .02 .003"/></asset>"""


def thrown(shape, floor, timestep, cone, integrator, friction, velocity, height=0.1, surface="0 0"):
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>
      <option timestep="{timestep}" cone="{cone}" integrator="{integrator}"/>{PRISM}
      <default><geom friction="{friction} .005 .0001"/></default><worldbody>
      {FLOORS[floor].replace("/>", f' surfacevel="{surface} 0 0 0 0"/>')}
      <body pos="0 0 {height}"><freejoint/><geom {SHAPES[shape]} mass=".1"/></body>
      </worldbody></mujoco>""")
    data = mujoco.MjData(model)
    data.qvel[:3] = velocity
    return model, data


def rises(model, data, seconds, guarded):
    """Highest upward velocity [m/s], and whether the guard acted."""
    guard, up, acted = GuardedStepper(model, data) if guarded else None, 0.0, False
    for _ in range(round(seconds / model.opt.timestep)):
        if guard is None:
            mujoco.mj_step(model, data)
        else:
            acted |= bool(guard.step().cuts)
        up = max(up, float(data.qvel[2]))
    return up, acted


@given(
    st.sampled_from(list(SHAPES)),
    st.sampled_from(CONES),
    st.sampled_from(INTEGRATORS),
    st.sampled_from([2e-3, 5e-3]),
    st.sampled_from([0.3, 1.0, 2.0]),
    st.floats(0, 12),
    st.floats(5, 25),
    st.floats(0, 2 * np.pi),
)
@settings(max_examples=30, deadline=None)
def test_nothing_rises_faster_than_with_fine_plain_steps(
    shape, cone, integrator, timestep, friction, sideways, down, angle
):
    """The reference: ``mj_step`` at 1/50 of the step, on a plane, which nothing tunnels."""
    velocity = [sideways * np.cos(angle), sideways * np.sin(angle), -down]
    physics = (cone, integrator, friction, velocity)
    up, acted = rises(*thrown(shape, "plate", timestep, *physics), 0.1 / down + 0.04, True)
    fine = rises(*thrown(shape, "plane", timestep / 50, *physics), 0.1 / down + 0.04, False)[0]
    assert up <= fine + 0.01 * down or not acted


@pytest.mark.parametrize("cone", CONES)
@pytest.mark.parametrize("timestep", [2e-3, 5e-3])
@pytest.mark.parametrize(("sideways", "down"), [(3, 5), (3, 15), (10, 15)])
def test_a_flat_box_that_slides_after_an_impact_stays_down(cone, timestep, sideways, down):
    scene = thrown("box", "plate", timestep, cone, "Euler", 1.0, [sideways, 0, -down], 0.5)
    up, acted = rises(*scene, 1.0, True)
    assert acted
    assert up < 0.01 * down


@pytest.mark.parametrize("cone", CONES)
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_an_impact_brakes_a_slider_by_friction_times_the_normal_impulse(cone, integrator):
    """Coulomb: 10 m/s down and friction 0.2 take 2 of 7 m/s; friction 1 takes all.

    Held contacts have an impedance of 0.99, not 1, which leaves some per cent of a velocity.
    """
    for friction, left in ((0.2, 5.0), (1.0, 0.0)):
        model, data = thrown("box", "plate", 5e-3, cone, integrator, friction, [7, 0, -10])
        model.opt.gravity[:] = 0
        guard = GuardedStepper(model, data)
        while not guard.step().cuts:
            pass
        np.testing.assert_allclose(data.qvel[:3], [left, 0, 0], atol=0.05 * 10)


@pytest.mark.parametrize("cone", CONES)
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_ball_that_slides_into_an_impact_leaves_it_rolling(cone, integrator):
    """A sliding ball that hits hard sticks: it rolls at 5/7 of its speed."""
    model, data = thrown("ball", "plate", 5e-3, cone, integrator, 1.0, [7, 0, -20])
    model.opt.gravity[:] = 0
    guard = GuardedStepper(model, data)
    while not guard.step().cuts:
        pass
    np.testing.assert_allclose(data.qvel[[0, 2]], [5, 0], atol=0.01 * 20)
    assert data.qvel[4] == pytest.approx(500, rel=0.02)


@pytest.mark.parametrize("cone", CONES)
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_part_that_is_dropped_on_a_belt_takes_its_speed_and_stays_on_it(cone, integrator):
    scene = thrown("box", "plate", 5e-3, cone, integrator, 1.0, [0, 0, -15], surface="3 0")
    up, acted = rises(*scene, 0.5, True)
    assert acted
    assert up < 0.1
    np.testing.assert_allclose(scene[1].qvel[:2], [3, 0], atol=0.05)
    np.testing.assert_allclose(scene[1].qvel[3:], 0, atol=1.0)


@pytest.mark.parametrize("density", [1e-5, 1e-2])
@pytest.mark.parametrize(("gear", "least"), [(2, 1.5), (30, 20.0)])
def test_a_light_body_on_a_damped_joint_does_not_stop_an_arm(density, gear, least):
    """A puck of 8 ng or 8 mg; without it the arm reaches 1.9 and 30 rad/s."""
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>
      <option timestep="0.01" gravity="0 0 0"/>
      <default><geom density="300" margin=".002" condim="1"/></default><worldbody>
      <body><joint name="j" axis="0 0 1" damping="1" armature=".04"/>
      <geom type="capsule" fromto="0 0 0 .5 0 0" size=".02"/></body>
      <body pos=".25 .15 0"><joint type="slide" axis="1 0 0" damping=".5"/>
      <joint type="slide" axis="0 1 0" damping=".5"/>
      <geom type="cylinder" size=".05 .05" density="{density}"/></body></worldbody>
      <actuator><motor joint="j" gear="{gear}"/></actuator></mujoco>""")
    data = mujoco.MjData(model)
    data.ctrl[0] = 1
    guard, still = GuardedStepper(model, data), 0.0
    for _ in range(100):
        report = guard.step()
        still += report.standstill
        assert not report.exhausted
    assert still < 0.01
    assert data.qvel[0] > least
