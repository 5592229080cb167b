"""Guarded steps hold what plain steps pass by, and change nothing where nothing is missed."""

import weakref

import mujoco
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tauguard.contacts import GuardedStepper, State
from tauguard.contacts.guard.energy_budget import EnergyMeter
from tauguard.contacts.scenes import SCENES, ball_cloth, sphere_plate
from tauguard.contacts.scenes.impacts import IMPACT_POINTS

STATE = mujoco.mjtState.mjSTATE_INTEGRATION


def bits(model, data):
    state = np.empty(mujoco.mj_stateSize(model, STATE))
    mujoco.mj_getState(model, data, state, STATE)
    return state.tobytes()


def side(model, data, scratch):
    """On which side of the cloth the ball's centre is: the sign of the sheet's solid angle there.

    It lies in (0, 4 pi) on one side, in a pocket too, and crossing the sheet takes off 4 pi, so
    the sign turns wherever that happens, however the sheet is bent.
    """
    state = State.of(model, data, scratch)
    a, b, c = (
        state.flexvert_xpos[model.flex_elem.reshape(-1, 3)] - state.geom_xpos[model.geom("ball").id]
    ).transpose(1, 0, 2)
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    top = np.einsum("ij,ij->i", a, np.cross(b, c))
    dots = [np.einsum("ij,ij->i", x, y) for x, y in ((a, b), (b, c), (c, a))]
    bottom = la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb
    return np.sign(np.arctan2(top, bottom).sum())


def held(scene, timestep, stepper=None):
    """Whether the ball's centre never crosses the cloth, and how many steps touched."""
    model, data = scene.start(timestep)
    scratch = mujoco.MjData(model)
    guard = GuardedStepper(model, data, ["cloth"]) if stepper is None else None
    before, touched = side(model, data, scratch), 0
    for _ in range(round(scene.seconds / timestep) + 1):
        if guard is None:
            mujoco.mj_step(model, data)
        else:
            assert not guard.step().exhausted
        touched += data.ncon > 0
        if side(model, data, scratch) != before:
            return False, touched
    return True, touched


@pytest.mark.parametrize("impact", IMPACT_POINTS)
@pytest.mark.parametrize(("speed", "timestep"), [(5.0, 5e-3), (20.0, 2e-3), (50.0, 5e-3)])
@pytest.mark.parametrize("offset", [0.0, 0.35, 0.8])
def test_a_ball_is_held_by_the_cloth(speed, timestep, impact, offset):
    scene = ball_cloth(speed, offset * speed * timestep, impact)
    safe, touched = held(scene, timestep)
    assert safe
    assert touched


def test_plain_steps_let_the_same_ball_through():
    """What the guard is for: without it the centre does cross, at every one of these."""
    for speed, timestep in ((20.0, 2e-3), (50.0, 5e-3)):
        scene = ball_cloth(speed, 0.35 * speed * timestep)
        assert not held(scene, timestep, stepper="plain")[0]


@given(st.floats(0.5, 80), st.floats(0, 1), st.sampled_from([1e-3, 2e-3, 5e-3]), st.booleans())
@example(2.0, 0.0, 1e-3, False)  # creeps in: every step adds less than a tenth of the thickness
@settings(max_examples=40, deadline=None)
def test_a_sphere_is_held_by_a_thin_plate(speed, offset, timestep, stiff):
    scene = sphere_plate(speed, offset * speed * timestep, stiff)
    model, data = scene.start(timestep)
    guard = GuardedStepper(model, data, ["rigid"])
    for _ in range(round(scene.seconds / timestep) + 1):
        report = guard.step()
        assert not report.exhausted
        assert data.qpos[2] > 0


@pytest.mark.parametrize("name", SCENES)
def test_the_same_bits_where_nothing_is_missed(name):
    slow = {"ball_cloth": {"speed": 1.0}, "sphere_plate": {"speed": 1.0}}
    scene = SCENES[name](**slow.get(name, {}))
    states = []
    for guarded in (False, True):
        model, data = scene.start(1e-3)
        guard = GuardedStepper(model, data) if guarded else None
        touched = 0
        for _ in range(40):
            if scene.control is not None:
                scene.control(model, data)
            if guard is None:
                mujoco.mj_step(model, data)
            else:
                report = guard.step()
                assert report.steps == 1
                assert report.cuts == ()
                assert report.balance is None
            touched += data.ncon > 0
        states.append((bits(model, data), touched))
    assert states[0] == states[1]


def test_the_report_tells_what_was_done():
    """A ball of 20 g at 20 m/s: 4 J and 0.4 N s before."""
    model, data = ball_cloth(20.0, 0.01, stiff=False).start(5e-3)
    guard = GuardedStepper(model, data, ["cloth"])
    cut, clock = None, 0.0
    for _ in range(30):
        report = guard.step()
        clock += model.opt.timestep
        assert data.time == pytest.approx(clock, rel=1e-12)
        assert not report.impact_zones
        if report.cuts and cut is None:
            cut = report
    assert cut.cuts[0].pair == (("flex", 0), ("geom", 0))
    assert cut.steps > 1
    assert cut.balance.energy[0].tolist() == pytest.approx([0, 4.0, 0])
    assert cut.balance.momentum[0].tolist() == pytest.approx([0, 0, -0.4])
    assert cut.balance.energy[1].sum() <= 4.04
    assert cut.balance.energy[1, 2] > 0


@pytest.mark.parametrize("build", [ball_cloth, sphere_plate])
def test_with_next_to_no_work_partners_are_stopped_and_nothing_passes(build):
    for share in (0.1, 0.3, 0.5, 0.7, 0.9):
        scene = build(40.0, share * 0.2)
        model, data = scene.start(5e-3)
        guard = GuardedStepper(model, data, most=2)
        dof = int(model.body("ball").dofadr[0])
        height = int(model.jnt_qposadr[model.body("ball").jntadr[0]]) + 2
        zones = set()
        for _ in range(12):
            report = guard.step()
            assert report.steps <= 4
            assert not report.exhausted
            zones |= set(report.impact_zones)
            assert np.linalg.norm(data.qvel[dof : dof + 3]) < 40.4
        assert data.qpos[height] > (0 if build is sphere_plate else -0.15)
        assert zones <= set(guard.pairs)


@pytest.mark.parametrize("aside", [0.0, 2.0])
def test_partners_in_an_impact_zone_move_as_one_and_keep_their_momentum(aside):
    """Two free bodies, 1 and 3 kg, meet at 400 m/s; MuJoCo's memory is too small for contacts."""
    model = mujoco.MjModel.from_xml_string("""<mujoco><size memory="1500"/>
      <option gravity="0 0 0" timestep="2e-3"/><worldbody>
      <body><freejoint/><geom size=".1" mass="1"/></body>
      <body pos=".5 0 0"><freejoint/><geom size=".1" mass="3"/></body></worldbody></mujoco>""")
    data = mujoco.MjData(model)
    data.qvel[[0, 1, 6]] = 200, aside, -200

    def motion():
        """Momentum m v, its moment m x v + I w about the origin, and both w, in the world."""
        mujoco.mj_kinematics(model, data)
        mass, turn = model.body_mass[1:, None], data.xmat[1:].reshape(2, 3, 3)
        velocity, spin = np.split(data.qvel.reshape(2, 6), 2, axis=1)
        spins = np.einsum("bij,bj->bi", turn, spin)
        own = model.body_inertia[1:] * spins  # those of balls, the same in every frame
        moment = np.cross(data.xipos[1:], mass * velocity) + own
        return np.concatenate([(mass * velocity).sum(0), moment.sum(0)]), spins

    before, _ = motion()
    report = GuardedStepper(model, data, most=2).step()
    assert report.impact_zones == ((("geom", 0), ("geom", 1)),)
    assert not report.passed
    after, (one, other) = motion()
    np.testing.assert_allclose(after, before, atol=1e-9)
    np.testing.assert_allclose(one, other, atol=1e-9)
    assert bool(one.any()) == bool(aside)
    if not aside:
        np.testing.assert_allclose(data.qvel, [-100, 0, 0, 0, 0, 0] * 2, atol=1e-9)


def test_heavy_and_light_partners_in_one_impact_zone_do_not_stand_still():
    """Two pairs of equal bodies, 1 kg and 1 mg, meet: each moves on with its mean velocity.

    Spinning a ball of 1 mg and 1 mm takes 2.5e-12 of the impulse times length that 1 kg takes.
    """
    model = mujoco.MjModel.from_xml_string("""<mujoco><size memory="2600"/>
      <option gravity="0 0 0" timestep="2e-3"/><worldbody>
      <body><freejoint/><geom size=".1" mass="1"/></body>
      <body pos=".5 0 0"><freejoint/><geom size=".1" mass="1"/></body>
      <body pos="0 9 0"><freejoint/><geom size=".001" mass="1e-6"/></body>
      <body pos=".005 9 0"><freejoint/><geom size=".001" mass="1e-6"/></body>
      </worldbody></mujoco>""")
    data = mujoco.MjData(model)
    data.qvel[::6] = 300, -100, 3, -1
    report = GuardedStepper(model, data, most=2).step()
    assert len(report.impact_zones) == 2
    np.testing.assert_allclose(data.qvel[::6], [100, 100, 1, 1], rtol=1e-9)


def test_a_state_that_somebody_changes_is_seen():
    """The guard keeps the last step's end; a ball that is put elsewhere starts from there."""
    model, data = ball_cloth(50.0, offset=1.0).start(1e-3)
    guard = GuardedStepper(model, data, ["cloth"])
    assert not guard.step().cuts
    data.qpos[-5] = 0.02
    assert guard.step().cuts


def test_the_report_tells_what_mujoco_listed():
    """At 50 m/s and 5 ms plain steps list nothing; guarded ones do, from the first cut on."""
    scene = ball_cloth(50.0, offset=0.5)
    model, data = scene.start(5e-3)
    for _ in range(4):
        mujoco.mj_step(model, data)
        assert data.ncon == 0
    guard = GuardedStepper(*scene.start(5e-3), ["cloth"])
    reports = [guard.step() for _ in range(4)]
    assert [r.contacts > 0 for r in reports][:3] == [False, False, True]
    assert [len(r.cuts) > 0 for r in reports[:3]] == [False, False, True]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m: setattr(m.opt, "integrator", mujoco.mjtIntegrator.mjINT_RK4), "RK4"),
        (lambda m: setattr(m.opt, "enableflags", mujoco.mjtEnableBit.mjENBL_SPECULATIVE), "specul"),
        (lambda m: setattr(m.opt, "enableflags", mujoco.mjtEnableBit.mjENBL_IPC), "flag ipc"),
        (lambda m: setattr(m.opt, "enableflags", mujoco.mjtEnableBit.mjENBL_SLEEP), "flag sleep"),
    ],
)
def test_what_cannot_be_taken_back_is_refused(change, message):
    model, data = sphere_plate().start()
    change(model)
    with pytest.raises(ValueError, match=message):
        GuardedStepper(model, data)


def test_bad_input_is_named():
    model, data = sphere_plate().start()
    with pytest.raises(ValueError, match=r"checker 'cloths': expected rigid or cloth"):
        GuardedStepper(model, data, ["cloths"])
    with pytest.raises(ValueError, match="most 1"):
        GuardedStepper(model, data, most=1)


def test_only_what_is_asked_for_is_covered():
    model, data = ball_cloth(50.0).start(5e-3)
    assert GuardedStepper(model, data).pairs == ((("flex", 0), ("geom", 0)),)
    guard = GuardedStepper(model, data, ["rigid"])
    assert guard.pairs == ()
    for _ in range(6):
        assert guard.step().steps == 1
    assert data.qvel[-4] == -50.0


def test_what_may_touch_and_is_not_covered_is_named():
    model = mujoco.MjModel.from_xml_string("""<mujoco><asset>
      <hfield name="hills" nrow="2" ncol="2" size="1 1 .1 .1" elevation="0 0 0 0"/></asset>
      <worldbody><geom name="hills" type="hfield" hfield="hills"/>
      <body pos="0 0 1"><freejoint/><geom name="ball" size=".1"/></body>
      <flexcomp name="rope" type="grid" dim="1" count="4 1 1" spacing=".1 .1 .1" radius=".01"
        mass=".1"><edge equality="true"/><contact selfcollide="auto"/></flexcomp>
      </worldbody></mujoco>""")
    guard = GuardedStepper(model, mujoco.MjData(model))
    hills, ball, rope = ("geom", 0), ("geom", 1), ("flex", 0)
    assert guard.pairs == ((rope, ball),)
    assert set(guard.uncovered) == {(hills, ball), (rope, hills), (rope, rope)}
    rigid = GuardedStepper(model, mujoco.MjData(model), ["rigid"])
    assert rigid.pairs == ()
    assert (rope, ball) in rigid.uncovered


def test_a_step_that_mujoco_resets_names_every_pair():
    """A number that is not finite: MuJoCo starts the scene anew, and nothing is known of it."""
    model, data = sphere_plate().start()
    guard = GuardedStepper(model, data)
    assert not guard.step().exhausted
    data.qvel[0] = np.nan
    report = guard.step()
    assert report.exhausted
    assert report.passed == guard.pairs


def test_pairs_of_a_report_have_names():
    model, data = ball_cloth(speed=50.0).start(5e-3)
    with GuardedStepper(model, data) as guard:
        cuts = [cut for _ in range(4) for cut in guard.step().cuts]
        assert {guard.partners(cut.pair) for cut in cuts} == {("flex 'cloth_sheet'", "geom 'ball'")}
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 0.1])
    body = spec.worldbody.add_body(name="cup", pos=[0, 0, 1])
    body.add_freejoint()
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.1, 0, 0])
    model = spec.compile()
    guard = GuardedStepper(model, mujoco.MjData(model))
    expected = ("geom 0 (of body 'world')", "geom 1 (of body 'cup')")
    assert [guard.partners(pair) for pair in guard.pairs] == [expected]


def test_a_rotor_that_turns_more_than_half_a_turn_a_step_does_not_skip_a_wall():
    """5 rad a step: by the shortest way it would turn back 1.3 rad, away from the wall."""
    model = mujoco.MjModel.from_xml_string("""<mujoco><option timestep="5e-3" gravity="0 0 0"
      integrator="implicitfast"/><worldbody>
      <body><joint axis="0 0 1"/><geom type="capsule" fromto="0 0 0 .2 0 0" size=".005"/></body>
      <geom type="box" pos="0 .1 0" size=".002 .05 .05"/></worldbody></mujoco>""")
    data = mujoco.MjData(model)
    data.qvel[0] = 1000
    guard = GuardedStepper(model, data)
    for _ in range(20):
        assert not guard.step().exhausted
        assert data.qpos[0] < np.pi / 2


def test_a_guard_is_freed_with_its_last_name():
    model, data = sphere_plate().start()
    guard = GuardedStepper(model, data)
    guard.step()
    gone = weakref.ref(guard)
    del guard
    assert gone() is None


def test_the_stretch_energy_has_mujocos_spring_force_as_its_gradient():
    model, data = ball_cloth(count=4).start()
    rng = np.random.default_rng(0)
    data.qpos[:12] += rng.normal(size=12) * 0.01
    data.qvel[:] = 0
    mujoco.mj_forward(model, data)
    books, step = EnergyMeter(model), 1e-6

    def energy(dof, sign):
        moved = mujoco.MjData(model)
        moved.qpos[:] = data.qpos
        moved.qpos[dof] += sign * step
        state = np.empty(mujoco.mj_stateSize(model, STATE))
        mujoco.mj_getState(model, moved, state, STATE)
        return books.between(state, state).energy[0, 2]

    slopes = [(energy(i, 1) - energy(i, -1)) / (2 * step) for i in range(12)]
    assert np.abs(data.qfrc_spring[:12]).max() > 1
    np.testing.assert_allclose(-np.array(slopes), data.qfrc_spring[:12], rtol=1e-6, atol=1e-4)
