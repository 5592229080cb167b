"""Copies of a guard continue with the same bits."""

import copy
import pickle

import mujoco
import numpy as np
import pytest

from tauguard.contacts import GuardedStepper
from tauguard.contacts.scenes import ball_cloth, sphere_plate

STATE = mujoco.mjtState.mjSTATE_INTEGRATION
WAYS = {"deepcopy": copy.deepcopy, "pickle": lambda guard: pickle.loads(pickle.dumps(guard))}


def bits(guard):
    state = np.empty(mujoco.mj_stateSize(guard.model, STATE))
    mujoco.mj_getState(guard.model, guard.data, state, STATE)
    return state.tobytes()


def paddle():
    """A mocap paddle that strikes free balls: the way of the next step begins at the last pose."""
    model = mujoco.MjModel.from_xml_string("""<mujoco><option timestep="5e-3"/><worldbody>
      <geom type="plane" size="3 3 .1"/>
      <body name="paddle" mocap="true" pos="-.3 0 .1"><geom type="box" size=".002 .1 .1"/></body>
      <body pos="0 0 .05"><freejoint/><geom size=".03" mass=".1"/></body>
      <body pos=".2 .02 .05"><freejoint/><geom type="box" size=".03 .02 .01" mass=".1"/></body>
      </worldbody></mujoco>""")
    return model, mujoco.MjData(model)


SCENES = {
    "cloth": lambda: ball_cloth(50.0, stiff=False).start(5e-3),
    "plate": lambda: sphere_plate(40.0, 0.3).start(2e-3),
    "paddle": paddle,
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", SCENES)
def test_a_copy_at_any_step_continues_with_the_same_bits(name, way):
    guard, cuts, copies = GuardedStepper(*SCENES[name]()), 0, []
    for k in range(24):
        copies.append(WAYS[way](guard))
        for one in (guard, *copies):
            if one.model.nmocap:
                one.data.mocap_pos[0, 0] = -0.3 + 0.06 * k
        report = guard.step()
        cuts += len(report.cuts)
        for one in copies:
            assert one.step() == report
            assert bits(one) == bits(guard)
    assert cuts > 0


def test_a_plain_copy_steps_the_same_data():
    guard = GuardedStepper(*SCENES["plate"](), ["rigid"], most=30)
    other = copy.copy(guard)
    assert other.model is guard.model
    assert other.data is guard.data
    assert other.most == 30
    time = guard.data.time
    guard.step()
    other.step()
    assert guard.data.time == pytest.approx(time + 2 * guard.model.opt.timestep)


@pytest.mark.parametrize("way", WAYS)
def test_what_holds_a_guard_and_its_data_keeps_them_together(way):
    guard = GuardedStepper(*SCENES["plate"]())
    model, data, other = WAYS[way]((guard.model, guard.data, guard))
    assert other.model is model
    assert other.data is data


def test_a_copy_while_an_edit_waits():
    guard = GuardedStepper(*SCENES["plate"]())
    guard.step()
    guard.model.geom_contype[:] = 0
    guard.model.geom_conaffinity[:] = 0
    other = copy.deepcopy(guard)
    assert other.pairs == guard.pairs == ()


def test_a_saved_state_of_another_scene_is_refused():
    one, other = GuardedStepper(*SCENES["plate"]()), GuardedStepper(*SCENES["cloth"]())
    with pytest.raises(ValueError, match="another model"):
        one._guard.restore(other._guard.saved())
