"""The oracle of tunnelling and energy, where closed forms say what passes through what."""

import mujoco
import numpy as np
import pytest

from oracles.energy import EnergyGain
from oracles.tunnelling import Tunnelling
from tauguard.contacts.scenes import ball_cloth, sphere_plate

NO_CONTACTS = int(mujoco.mjtDisableBit.mjDSBL_CONTACT)


def passes(second, velocity):
    """Whether a ball and another body pass through each other in a step without contacts."""
    options = '<option gravity="0 0 0" timestep="0.01"/>'
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco>{options}<worldbody><geom size=".1"/>{second}</worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    tunnelling = Tunnelling(model, data)
    model.opt.disableflags |= NO_CONTACTS
    data.qvel[0] = velocity
    mujoco.mj_step(model, data)
    tunnelling.observe(data)
    return bool(tunnelling.pairs)


@pytest.mark.parametrize(
    ("shape", "offset", "expected"),
    [
        ('size=".1"', 0.0, True),
        ('size=".1"', 0.005, True),  # both are eroded to 3 mm
        ('size=".1"', 0.007, False),
        ('type="box" size=".1 .2 .1"', 0.105, True),  # eroded, it reaches to .103
        ('type="box" size=".1 .2 .1"', 0.11, False),
        ('type="capsule" size=".1 .2" euler="90 0 0"', 0.205, True),
        ('type="capsule" size=".1 .2" euler="90 0 0"', 0.207, False),
    ],
)
def test_eroded_shapes_that_meet_between_two_states_have_passed(shape, offset, expected):
    body = f'<body pos="1 {offset} 0"><freejoint/><geom {shape}/></body>'
    assert passes(body, -200.0) is expected


@pytest.mark.parametrize(("turn", "expected"), [(0.0, False), (400.0, False), (500.0, True)])
def test_whole_turns_are_followed(turn, expected):
    """A rod reaches the ball at 4.7 rad; 5 rad have the end poses of 1.3 rad the other way."""
    rod = """<body pos="1 0 0"><joint axis="0 0 1"/>
      <geom type="capsule" fromto="0 0 0 0 -1 0" size=".01"/></body>"""
    assert passes(rod, turn) is expected


@pytest.mark.parametrize("back", [False, True])
@pytest.mark.parametrize("build", [ball_cloth, sphere_plate])
def test_what_flies_through_without_contacts_has_passed_and_what_turns_back_has_not(build, back):
    scene = build(speed=20.0)
    model, data = scene.start(2e-3)
    tunnelling = Tunnelling(model, data)
    model.opt.disableflags |= NO_CONTACTS
    if back:
        data.qvel[:] *= -1
    for _ in range(20):
        mujoco.mj_step(model, data)
        tunnelling.observe(data)
    assert bool(tunnelling.pairs) is not back


def test_twice_the_speed_is_four_times_the_energy():
    model, data = sphere_plate(speed=1.0).start(1e-3)
    gain = EnergyGain(model, data)
    data.qvel[:] *= 2
    mujoco.mj_step(model, data)
    gain.observe(data)
    assert gain.most == pytest.approx(4, rel=0.01)
    data.qpos[0] = np.nan
    gain.observe(data)
    assert gain.most == np.inf
