"""Contacts that a guard adds are bounded, and too little memory is no error."""

import mujoco
import numpy as np
import pytest

from tauguard.contacts import GuardedStepper


def pinched(count, timestep, force, memory=""):
    """Two fingers on a lift pinch a cloth on a table."""
    return mujoco.MjModel.from_xml_string(f"""<mujoco>{memory}
      <option timestep="{timestep}" integrator="implicitfast" solver="CG" tolerance="1e-6"
        jacobian="sparse"/>
      <worldbody><geom type="box" size=".3 .3 .02" pos="0 0 -.02"/>
      <flexcomp name="cloth" type="grid" dim="2" count="{count} {count} 1" pos="0 0 .004"
        spacing="{0.24 / (count - 1)} {0.24 / (count - 1)} .02" radius=".002" mass=".05">
        <edge equality="true" damping=".01"/><contact selfcollide="auto" solref=".005 1"/>
      </flexcomp>
      <body pos="0 0 .12"><joint name="lift" type="slide" axis="0 0 1" damping="20"/>
        <geom type="box" size=".05 .03 .01" mass=".7"/>
        <body pos=".04 0 -.06"><joint name="l" type="slide" axis="1 0 0" damping="5"/>
          <geom type="box" size=".008 .012 .04" mass=".05" friction="2"/></body>
        <body pos="-.04 0 -.06"><joint name="r" type="slide" axis="1 0 0" damping="5"/>
          <geom type="box" size=".008 .012 .04" mass=".05" friction="2"/></body></body></worldbody>
      <actuator><position joint="lift" kp="5000" dampratio="1"/>
        <position joint="l" kp="500" forcerange="-{force} {force}" forcelimited="true"/>
        <position joint="r" kp="500" forcerange="-{force} {force}" forcelimited="true"/></actuator>
      </mujoco>""")


def most_contacts(model, guarded, seconds=0.24):
    data = mujoco.MjData(model)
    guard, most = GuardedStepper(model, data) if guarded else None, 0
    for _ in range(round(seconds / model.opt.timestep)):
        close = 0.035 if data.time > 0.1 else 0.0
        data.ctrl[:] = [-0.035, -close, close]
        if guard is None:
            mujoco.mj_step(model, data)
            most = max(most, data.ncon)
        else:
            most = max(most, guard.step().contacts)
    assert np.isfinite(data.qpos).all()
    return most


@pytest.mark.parametrize(("timestep", "force"), [(2e-3, 20), (5e-3, 200)])
def test_a_pinched_cloth_runs_in_the_memory_of_plain_steps(timestep, force):
    plain = most_contacts(pinched(13, timestep, force), False)
    assert most_contacts(pinched(13, timestep, force), True) <= 4 * plain + 1000


def test_without_memory_for_contacts_steps_are_taken_and_reported():
    """Two balls meet at 400 m/s; a contact does not fit into MuJoCo's memory."""
    model = mujoco.MjModel.from_xml_string("""<mujoco><size memory="1500"/>
      <option gravity="0 0 0" timestep="2e-3"/><worldbody>
      <body><freejoint/><geom size=".1" mass="1"/></body>
      <body pos=".5 0 0"><freejoint/><geom size=".1" mass="3"/></body></worldbody></mujoco>""")
    data = mujoco.MjData(model)
    data.qvel[[0, 6]] = 200, -200
    guard, reports = GuardedStepper(model, data), []
    for _ in range(3):
        reports.append(guard.step())
    assert any(report.unaided for report in reports)
    assert not any(report.exhausted for report in reports)
    assert data.qpos[0] < data.qpos[7]
    assert data.time == pytest.approx(3 * 2e-3)
