"""What is changed between two steps is honoured at the next one, or refused there by name."""

import copy
import re

import mujoco
import numpy as np
import pytest

from tauguard.contacts import GuardedStepper
from tauguard.contacts.scenes import ball_cloth

STATE = mujoco.mjtState.mjSTATE_INTEGRATION
FLOOR = '<geom name="floor" type="box" pos="0 0 -.001" size="1 1 .001"/>'
BALL = '<body name="ball" pos="0 0 1"><freejoint/><geom name="ball" size=".01" mass=".02"/></body>'


def model_of(world=FLOOR, bodies=BALL, extra=""):
    return mujoco.MjModel.from_xml_string(f"""<mujoco>
      <option timestep="2e-3" integrator="implicitfast" gravity="0 0 0"/>
      <worldbody>{world}{bodies}</worldbody>{extra}</mujoco>""")


def falling(model, speed=80.0):
    data = mujoco.MjData(model)
    data.qvel[2] = -speed
    return data, GuardedStepper(model, data)


def bits(model, data):
    state = np.empty(mujoco.mj_stateSize(model, STATE))
    mujoco.mj_getState(model, data, state, STATE)
    return state.tobytes()


def lowest(guard, steps=20):
    """The ball's lowest centre [m] at the ends of so many steps, none of them lost."""
    low = np.inf
    for _ in range(steps):
        assert not guard.step().exhausted
        low = min(low, float(guard.data.qpos[2]))
    return low


def option(name, value):
    return lambda model, data: setattr(model.opt, name, value)


def put(field, row, value, of="model"):
    def edit(model, data):
        getattr(model if of == "model" else data, field)[row] = value

    return edit


PADDLE = '<body mocap="true" pos="0 0 3"><geom size=".1"/></body>'


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (option("integrator", mujoco.mjtIntegrator.mjINT_RK4), "integrator RK4"),
        (option("cone", 5), "cone 5"),  # of which MuJoCo's own step crashes at a contact
        (option("enableflags", mujoco.mjtEnableBit.mjENBL_IPC), "option flag ipc"),
        (option("enableflags", mujoco.mjtEnableBit.mjENBL_SPECULATIVE), "option flag speculative"),
        (option("enableflags", mujoco.mjtEnableBit.mjENBL_SLEEP), "option flag sleep"),
        (option("timestep", np.inf), "timestep inf"),
        (option("timestep", np.nan), "timestep nan"),
        (option("timestep", 0.0), "timestep 0.0"),
        (option("timestep", -1e-3), "timestep -0.001"),
        (put("geom_pos", 2, [0, np.nan, 0]), "geom_pos: row 2 is"),
        (put("geom_size", 2, [-1, 0, 0]), "geom_size: row 2 is"),
        (put("geom_quat", 0, [2, 0, 0, 0]), "geom_quat: row 0 is"),
        (put("body_mass", 2, np.nan), "body_mass: row 2 is nan, not finite"),
        (put("body_mass", 2, -0.02), "body_mass: row 2 is -0.02, negative"),
        (put("body_inertia", 2, [1, np.nan, 1]), "body_inertia: row 2 is"),
        (put("body_inertia", 2, [1e-3, -1e-3, 1e-3]), "body_inertia: row 2 is"),
        (put("geom_margin", 0, np.inf), "geom_margin: row 0 is inf, not finite"),
        (put("geom_solref", 2, [np.nan, 1]), "geom_solref: row 2 is"),
        (put("geom_solimp", 2, np.nan), "geom_solimp: row 2 is"),
        (put("geom_friction", 2, np.nan), "geom_friction: row 2 is"),
        (put("dof_damping", 0, np.nan), "dof_damping: row 0 is nan, not finite"),
        (put("dof_armature", 0, -1), "dof_armature: row 0 is -1.0, negative"),
        (put("qpos0", 2, np.nan), "qpos0: row 2 is nan, not finite"),
        (put("qpos_spring", 2, np.inf), "qpos_spring: row 2 is inf, not finite"),
        (option("gravity", [0, 0, np.nan]), "opt.gravity: [0.0, 0.0, nan], not finite"),
        (option("density", np.inf), "opt.density: inf, not finite"),
        (option("o_solref", [np.nan, 1]), "opt.o_solref: [nan, 1.0], not finite"),
        (put("geom_condim", 0, 7), "geom_condim: row 0 is 7, not 1, 3, 4 or 6"),
        (put("geom_type", 0, 99), "geom_type: row 0 is 99, an unknown type"),
        (put("geom_dataid", 2, 0), "geom_dataid: row 2 is 0, no such object"),
        (put("mocap_pos", 0, np.nan, of="data"), "mocap_pos: row 0 is"),
        (put("mocap_quat", 0, np.inf, of="data"), "mocap_quat: row 0 is"),
    ],
)
def test_what_cannot_be_followed_is_refused_by_name_until_it_is_taken_back(edit, message):
    model = model_of(FLOOR + PADDLE)
    data, guard = falling(model)
    guard.step()
    kept, poses = copy.copy(model), (data.mocap_pos.copy(), data.mocap_quat.copy())
    edit(model, data)
    before = bits(model, data)
    for _ in range(2):
        with pytest.raises(ValueError, match=re.escape(message)):
            guard.step()
        assert bits(model, data) == before
    with pytest.raises(ValueError, match=re.escape(message)):
        GuardedStepper(model, data)
    for name in dir(kept):
        array = getattr(kept, name)
        if isinstance(array, np.ndarray) and getattr(model, name).flags.writeable:
            getattr(model, name)[:] = array
    for name in dir(kept.opt):
        if not name.startswith("_"):
            setattr(model.opt, name, getattr(kept.opt, name))
    data.mocap_pos[:], data.mocap_quat[:] = poses
    assert lowest(guard) > 0


@pytest.mark.parametrize(
    ("field", "row", "value"),
    [
        *(("body_geomnum", 1, 99), ("body_dofadr", 1, 50), ("dof_Madr", 3, -7)),
        *(("jnt_qposadr", 0, 5), ("jnt_type", 0, 1), ("geom_bodyid", 1, 0)),
        *(("actuator_trnid", (0, 0), 40), ("actuator_actnum", 0, -1), ("sensor_objid", 0, 70)),
    ],
)
def test_how_the_model_is_built_is_not_edited(field, row, value):
    """MuJoCo would read beyond its arrays: many of these ended the process."""
    extra = """<actuator><motor name="m" site="s"/></actuator>
      <sensor><framepos objtype="body" objname="ball"/></sensor>"""
    model = model_of(bodies=BALL.replace("/></body>", '/><site name="s"/></body>'), extra=extra)
    data, guard = falling(model)
    guard.step()
    kept = int(getattr(model, field)[row])
    before = bits(model, data)
    getattr(model, field)[row] = value
    for _ in range(2):
        with pytest.raises(ValueError, match=rf"{field}: row \d is .*{value}.*recompile"):
            guard.step()
        assert bits(model, data) == before
    getattr(model, field)[row] = kept
    assert lowest(guard) > 0


def test_a_contact_filter_is_refused():
    _data, guard = falling(model_of())
    mujoco.set_mjcb_contactfilter(lambda model, data, first, second: 1)
    try:
        with pytest.raises(ValueError, match="mjcb_contactfilter"):
            guard.step()
    finally:
        mujoco.set_mjcb_contactfilter(None)
    assert lowest(guard) > 0


@pytest.mark.parametrize("floor", ["box", "plane"])
def test_a_floor_that_is_raised_holds_where_it_is(floor):
    """A floor with another place than its body: MuJoCo's kinematics follow ``geom_pos``."""
    shape = 'type="plane" size="1 1 .1"' if floor == "plane" else 'type="box" size="1 1 .001"'
    model = model_of(f'<geom name="floor" pos="0 0 -.5" {shape}/>')
    _data, guard = falling(model)
    guard.step()
    model.geom_pos[0, 2] = 0.4
    assert 0.4 < lowest(guard) < 0.45


def test_a_floor_that_mujoco_leaves_in_the_frame_of_its_body_stays():
    """Compiled at the body's origin: MuJoCo ignores ``geom_pos`` unless ``geom_sameframe`` is 0."""
    model = model_of('<geom name="floor" type="box" size="1 1 .001"/>')
    data, guard = falling(model)
    model.geom_pos[0, 2] = 0.4
    guard.step()
    assert data.geom_xpos[0, 2] == 0
    assert 0 < lowest(guard, 4) < 0.38
    model.geom_sameframe[0] = 0
    model.geom_pos[0, 2] = -0.4
    data.qpos[2], data.qvel[2] = 0.5, -80
    assert -0.4 < lowest(guard) < 0


def test_a_geom_that_follows_its_bodys_inertia_is_where_mujoco_puts_it():
    box = 'type="box" pos=".02 0 0" euler="30 20 0" size=".01 .02 .03"'
    model = model_of(bodies=BALL.replace('size=".01"', box))
    data, guard = falling(model)
    guard.step()
    assert model.geom_sameframe[1] == mujoco.mjtSameFrame.mjSAMEFRAME_INERTIA
    model.body_ipos[1] = [0, 0, 0.3]
    for _ in range(20):
        assert not guard.step().exhausted
        mujoco.mj_kinematics(model, data)
        assert data.geom_xpos[1, 2] > 0


def test_a_ball_that_grows_is_held_by_its_new_radius():
    model = model_of()
    _data, guard = falling(model)
    guard.step()
    model.geom_size[1, 0] = model.geom_rbound[1] = 0.2
    assert 0.15 < lowest(guard) < 0.25


def test_a_body_whose_mass_is_changed_is_held():
    model = model_of()
    _data, guard = falling(model)
    guard.step()
    model.body_mass[1] *= 1000
    model.body_inertia[1] *= 1000
    assert lowest(guard) > 0


@pytest.mark.parametrize(
    ("off", "on"),
    [
        (put("geom_contype", 1, 0), put("geom_contype", 1, 1)),
        (
            option("disableflags", mujoco.mjtDisableBit.mjDSBL_CONTACT),
            option("disableflags", 0),
        ),
        (
            option("disableflags", mujoco.mjtDisableBit.mjDSBL_CONSTRAINT),
            option("disableflags", 0),
        ),
    ],
)
def test_contacts_that_are_switched_off_let_pass_with_the_bits_of_plain_steps(off, on):
    model = model_of()
    model.geom_contype[0] = 0  # the floor takes what the ball gives
    data, guard = falling(model)
    plain = mujoco.MjData(model)
    plain.qvel[2] = -80
    off(model, data)
    for _ in range(10):
        assert guard.step().steps == 1
        mujoco.mj_step(model, plain)
        assert bits(model, data) == bits(model, plain)
    assert guard.pairs == ()
    assert data.qpos[2] < -0.5
    on(model, data)
    data.qpos[2] = 0.5
    assert lowest(guard) > 0
    assert guard.pairs == ((("geom", 0), ("geom", 1)),)


def test_a_pair_stays_known_over_an_edit_of_another_geom():
    model = model_of(FLOOR + '<geom name="post" type="box" pos=".5 0 .1" size=".01 .01 .1"/>')
    _data, guard = falling(model)
    while not guard.step().cuts:
        pass
    model.geom_pos[1, 0] = 0.6
    assert lowest(guard) > 0


def test_a_body_that_an_edit_sinks_is_reported():
    """The pair was apart; after the edit its last eroded shapes meet, and nothing is known."""
    model = model_of('<geom name="floor" type="plane" pos="0 0 -.5" size="1 1 .1"/>')
    _data, guard = falling(model, speed=1.0)
    guard.step()
    model.geom_pos[0, 2] = 2.0
    assert guard.step().passed == guard.pairs


@pytest.mark.parametrize("edit", ["radius", "stiffness"])
def test_a_cloth_is_followed(edit):
    model, data = ball_cloth(50.0).start(5e-3)
    guard = GuardedStepper(model, data)
    guard.step()
    if edit == "radius":
        model.flex_radius[0] *= 2
    else:
        model.flex_stiffness[:] *= 0.5
    for _ in range(12):
        assert not guard.step().exhausted
    assert data.qvel[-4] > -5
    fresh = GuardedStepper(model, data)
    assert guard.pairs == fresh.pairs


def test_an_equality_that_is_switched_off_in_flight():
    bodies = BALL + BALL.replace("ball", "other").replace("0 0 1", ".05 0 1")
    model = model_of(bodies=bodies, extra='<equality><weld body1="ball" body2="other"/></equality>')
    data, guard = falling(model)
    data.qvel[8] = -80
    for k in range(30):
        data.eq_active[0] = k % 2
        assert not guard.step().exhausted
        assert data.qpos[2] > 0
        assert data.qpos[9] > 0


def test_a_keyframe_is_a_new_start():
    model = model_of(extra='<keyframe><key qpos="0 0 .1 1 0 0 0" qvel="0 0 -50 0 0 0"/></keyframe>')
    data, guard = falling(model)
    for _ in range(3):
        lowest(guard, 8)
        mujoco.mj_resetDataKeyframe(model, data, 0)
    assert lowest(guard) > 0


def test_margins_and_contact_parameters_of_all_contacts_are_overridden():
    model = model_of()
    _data, guard = falling(model)
    guard.step()
    model.opt.enableflags = mujoco.mjtEnableBit.mjENBL_OVERRIDE
    model.opt.o_margin = 0.001
    assert lowest(guard) > 0
    assert model.opt.o_margin == 0.001


@pytest.mark.parametrize("solver", [*mujoco.mjtSolver.__members__.values()])
@pytest.mark.parametrize("cone", [*mujoco.mjtCone.__members__.values()])
@pytest.mark.parametrize("integrator", ["mjINT_EULER", "mjINT_IMPLICIT", "mjINT_DISCRETE"])
def test_options_that_are_changed_in_flight(solver, cone, integrator):
    model = model_of()
    _data, guard = falling(model)
    guard.step()
    model.opt.solver, model.opt.cone = solver, cone
    model.opt.integrator = getattr(mujoco.mjtIntegrator, integrator)
    model.opt.timestep, model.opt.gravity[2] = 7e-3, -9.81
    assert lowest(guard) > 0


def test_a_recompiled_model_needs_a_guard_of_its_own():
    spec = mujoco.MjSpec.from_string(f"<mujoco><worldbody>{FLOOR}{BALL}</worldbody></mujoco>")
    model = spec.compile()
    guard = GuardedStepper(model, mujoco.MjData(model))
    spec.geom("ball").size[0] = 0.05
    other, data = spec.recompile(model, guard.data)
    assert other is not model
    for name, value in (("model", other), ("data", data)):
        with pytest.raises(AttributeError, match=name):
            setattr(guard, name, value)


def test_numbers_that_are_not_finite_are_reported_where_mujoco_does_not_reset():
    model = model_of()
    model.opt.disableflags = mujoco.mjtDisableBit.mjDSBL_AUTORESET
    data, guard = falling(model)
    guard.step()
    data.qvel[0] = np.nan
    assert guard.step().passed == guard.pairs


@pytest.mark.parametrize("field", ["qpos", "qvel", "qfrc_applied"])
@pytest.mark.parametrize("steps", [0, 1, 5])
def test_a_state_that_mujoco_resets_is_reported(field, steps):
    """At the start of a scene the time after a reset is that of a step."""
    model = model_of()
    data, guard = falling(model, 1.0)
    for _ in range(steps):
        assert not guard.step().exhausted
    getattr(data, field)[0] = np.nan
    assert guard.step().exhausted
    assert sum(warning.number for warning in data.warning) == 1
    assert lowest(guard) > 0


def test_what_an_edit_puts_into_one_another_is_named_until_it_has_parted():
    model = model_of()
    data, guard = falling(model, 0.0)
    guard.step()
    assert guard.sunk == ()
    data.qpos[2], data.qvel[:] = -0.001, 0.0  # the ball's centre is the floor's middle plane
    guard.step()
    (pair,) = guard.sunk
    assert set(guard.partners(pair)) == {"geom 'floor'", "geom 'ball'"}
    data.qpos[2], data.qvel[2] = 1.0, -0.1
    guard.step()
    assert guard.sunk == ()
