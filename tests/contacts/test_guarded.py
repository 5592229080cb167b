"""Guarded steps hold what plain steps pass by, and change nothing where nothing is missed."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tauguard.contacts import Contacts, GuardedStepper, State, checker
from tauguard.contacts.approach import Approach
from tauguard.contacts.balance import Books
from tauguard.contacts.scenes import SCENES, ball_cloth, sphere_plate
from tauguard.contacts.scenes.impacts import IMPACT_POINTS
from tauguard.contacts.stiffening import SOLREF, Stiffening

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
    """A ball of 20 g at 20 m/s: 4 J and 0.4 N s before; soft contacts are stiffened, then not."""
    scene = ball_cloth(20.0, 0.01, stiff=False)
    model, data = scene.start(5e-3)
    before = model.flex_solref.copy(), model.flex_priority.copy(), model.flex_solimp.copy()
    guard = GuardedStepper(model, data, ["cloth"], most=6)
    cut, restored, clock = None, (), 0.0
    for _ in range(12):
        report = guard.step()
        clock += model.opt.timestep
        assert data.time == clock
        assert model.opt.timestep == 5e-3
        assert 1 <= report.steps <= 6
        restored += report.restored
        if report.cuts and cut is None:
            cut = report
            assert guard.stiffened == ((("flex", 0), ("geom", 0)),)
            assert model.flex_solref[0, 0] == SOLREF[0]
    assert cut.cuts[0].stiffened
    assert 0 < cut.cuts[0].time < 5e-3
    assert cut.cuts[0].time == pytest.approx((0.005 + 0.01) / 20, abs=2e-6)
    assert cut.balance.energy[0].tolist() == pytest.approx([0, 4.0, 0])
    assert cut.balance.momentum[0].tolist() == pytest.approx([0, 0, -0.4])
    assert cut.balance.energy[1, 1] < 4.0
    assert cut.balance.energy[1, 2] > 0
    assert restored == ((("flex", 0), ("geom", 0)),)
    after = model.flex_solref, model.flex_priority, model.flex_solimp
    for a, b in zip(before, after, strict=True):
        np.testing.assert_array_equal(a, b)


def test_leaving_the_block_puts_the_parameters_back():
    scene = ball_cloth(50.0, stiff=False)
    model, data = scene.start(5e-3)
    with GuardedStepper(model, data, ["cloth"]) as guard:
        guard.step()
        assert guard.stiffened
    assert not guard.stiffened
    assert model.flex_solref[0].tolist() == [0.003, 1.0]


def test_without_stiffening_parameters_stay():
    scene = ball_cloth(50.0, stiff=False)
    model, data = scene.start(5e-3)
    guard = GuardedStepper(model, data, ["cloth"], stiff=False)
    report = guard.step()
    assert report.cuts
    assert not any(cut.stiffened for cut in report.cuts)
    assert model.flex_solref[0].tolist() == [0.003, 1.0]


class Crying:
    """A checker that always cries: the work must stay bounded."""

    name, covers = "crying", frozenset()

    def check(self, before, after):
        return Contacts(
            time=[0.0, 0.5],
            geom=[[1, 0]] * 2,
            flex=[[-1, -1]] * 2,
            feature=[[-1, -1]] * 2,
            point=[after.xpos[1]] * 2,
            normal=[[0, 0, -1.0], [np.nan] * 3],
            distance=[-1.0, 0.0],
        )


class Blind:
    """A checker that sees every contact and knows no normal."""

    def __init__(self, model, name, normal=np.nan):
        self.own, self.name, self.normal = checker(name, model), name, normal
        self.covers = self.own.covers

    def check(self, before, after):
        found = self.own.check(before, after)
        return replace(found, normal=np.full((len(found), 3), self.normal))


@given(st.floats(0.5, 80), st.floats(0, 1), st.sampled_from([1e-3, 5e-3]), st.floats(-0.2, 0.2))
@settings(max_examples=20, deadline=None)
def test_a_contact_without_a_normal_is_held_all_the_same(speed, offset, timestep, slant):
    scene = sphere_plate(speed, offset * speed * timestep)
    model, data = scene.start(timestep)
    data.qvel[0] = slant * speed
    with GuardedStepper(model, data, [Blind(model, "rigid")]) as guard:
        touched = 0
        for _ in range(round(scene.seconds / timestep) + 1):
            report = guard.step()
            assert not report.exhausted
            assert data.qpos[2] > 0
            touched += report.contacts
        assert touched


@pytest.mark.parametrize("normal", [np.nan, 0.0])
def test_a_straight_blow_is_cut_at_the_same_place_without_a_normal(normal):
    """Head on, the way of approach is the normal."""
    ends = []
    for blind in (False, True):
        model, data = ball_cloth(20.0, 0.01).start(5e-3)
        guard = GuardedStepper(model, data, [Blind(model, "cloth", normal) if blind else "cloth"])
        reports = [guard.step() for _ in range(2)]
        assert sum(len(r.cuts) for r in reports) > 0
        first = next(r.cuts[0] for r in reports if r.cuts)
        ends.append((first.time, first.pair, data.qvel[-4]))
    assert ends[1][0] == pytest.approx(ends[0][0], rel=1e-9)
    assert ends[1][1] == ends[0][1]
    assert ends[1][2] == pytest.approx(ends[0][2], rel=1e-3)


def test_surfaces_that_meet_from_the_start_have_the_direction_of_approach():
    """Two cubes by their surfaces, one corner in the other: the checker knows no normal there."""
    cube = " ".join(f"{x} {y} {z}" for x in (-1, 1) for y in (-1, 1) for z in (-1, 1))
    model = mujoco.MjModel.from_xml_string(f"""<mujoco><asset><mesh name="cube" vertex="{cube}"/>
      </asset><worldbody><geom type="mesh" mesh="cube"/><body pos="1.5 1.4 1.3"><freejoint/>
      <geom type="mesh" mesh="cube"/></body></worldbody></mujoco>""")
    data = mujoco.MjData(model)
    before = State.of(model, data)
    data.qpos[:3] += [0.03, 0, -0.04]
    after = State.of(model, data)
    found = checker("rigid", model, mesh="surface").check(before, after)
    assert np.isnan(found.normal).all()
    assert found.time.tolist() == [0]
    known, unknown = Approach(model).oriented(found, before, after)
    assert unknown.all()
    sign = 1 if found.geom[0, 0] == 0 else -1
    np.testing.assert_allclose(known.normal, [[-0.6 * sign, 0, 0.8 * sign]], atol=1e-12)
    assert Approach(model).depth(known, before, after) == pytest.approx([0.05], abs=1e-12)
    still, _ = Approach(model).oriented(found, before, before)
    assert still.normal.tolist() == [[0, 0, 0]]
    assert Approach(model).depth(still, before, before).tolist() == [0]


def test_a_triangle_that_has_collapsed_into_a_point_is_no_reason_to_fail():
    """A ball comes down on triangles whose corners all lie in one point."""
    model, data = ball_cloth(10.0).start(1e-3)
    before = State.of(model, data)
    corners = model.flex_elem.reshape(-1, 3)[:6].ravel()
    vertices = before.flexvert_xpos.copy()
    vertices[np.unique(corners)] = vertices[corners[0]]
    point = vertices[corners[0]] + [0, 0, model.flex_radius[0]]
    down = replace(before, flexvert_xpos=vertices)
    xpos = before.xpos.copy()
    xpos[model.body("ball").id] -= [0, 0, 0.002]
    after = replace(down, xpos=xpos)
    one = Contacts([0.0], [[0, -1]], [[-1, 0]], [[-1, 0]], [point], [[0, 0, -1.0]], [0.0])
    assert Approach(model).depth(one, down, after) == pytest.approx([0.002], abs=1e-12)


@pytest.mark.parametrize("field", ["point", "time", "distance"])
def test_a_contact_that_is_nowhere_is_refused_by_the_name_of_its_checker(field):
    class Nowhere(Crying):
        name = "nowhere"

        def check(self, before, after):
            found = super().check(before, after)
            value = getattr(found, field).copy()
            value[1] = np.nan
            return replace(found, **{field: value})

    model, data = sphere_plate(1.0).start(1e-3)
    with pytest.raises(ValueError, match=r"checker 'nowhere': the contact of .*'geom', 0.*nan"):
        GuardedStepper(model, data, [Nowhere()]).step()
    assert model.opt.timestep == 1e-3


def test_the_work_of_a_step_is_bounded_and_the_shortfall_is_told():
    model, data = sphere_plate(1.0).start(1e-3)
    guard = GuardedStepper(model, data, [Crying()], most=5)
    report = guard.step()
    assert report.exhausted
    assert report.steps <= 5 + 1 + 64
    assert data.time == 1e-3


def test_finer_pieces_after_a_cut_come_nearer_to_a_fine_reference():
    """The ball's velocity 30 ms after the touch, against fixed steps of 0.05 ms."""

    def velocity(timestep, **options):
        scene = ball_cloth(20.0, 0.01)
        model, data = scene.start(timestep)
        guard = GuardedStepper(model, data, **options) if options else None
        most = 0
        for _ in range(round(0.03 / timestep)):
            if guard is None:
                mujoco.mj_step(model, data)
            else:
                most = max(most, guard.step().steps)
        return data.qvel[model.body("ball").dofadr[0] + 2], most

    reference, _ = velocity(5e-5)
    coarse, few = velocity(5e-3, fine=1)
    fine, many = velocity(5e-3, fine=10)
    assert many >= 10 > few
    assert abs(fine - reference) < 0.7 * abs(coarse - reference)


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
    assert [r.contacts > 0 for r in reports] == [False, False, True, True]
    assert [len(r.cuts) > 0 for r in reports[:3]] == [False, False, True]


def test_a_checker_that_fails_leaves_the_timestep_alone():
    class Failing(Crying):
        def check(self, before, after):
            if after.time - before.time < 1e-3:
                raise RuntimeError("no")
            return super().check(before, after)

    model, data = sphere_plate(1.0).start(1e-3)
    with pytest.raises(RuntimeError, match="no"):
        GuardedStepper(model, data, [Failing()]).step()
    assert model.opt.timestep == 1e-3


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
    with pytest.raises(ValueError, match=r"checker 'cloths': there are .*cloth.*rigid"):
        GuardedStepper(model, data, ["cloths"])
    with pytest.raises(ValueError, match="most 1"):
        GuardedStepper(model, data, most=1)
    with pytest.raises(ValueError, match="fine 0"):
        GuardedStepper(model, data, fine=0)


def test_a_contact_pair_or_a_geom_is_stiffened_where_there_is_no_flex():
    model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody><geom name="a" size="1"/>
      <body><freejoint/><geom name="b" size="1" priority="3"/><geom name="c" size="1"/></body>
      </worldbody><contact><pair geom1="c" geom2="a"/></contact></mujoco>""")
    stiffening = Stiffening(model)
    ab, ac = (("geom", 0), ("geom", 1)), (("geom", 0), ("geom", 2))
    assert stiffening.stiffen(ab)
    assert not stiffening.stiffen(ab)
    assert model.geom_priority.tolist() == [4, 3, 0]
    assert stiffening.stiffen(ac)
    assert model.pair_solref[0, 0] == model.geom_solref[0, 0] == SOLREF[0]
    assert stiffening.pairs() == (ab, ac)
    assert stiffening.restore(ac)
    assert model.pair_solref[0, 0] == 0.02
    assert stiffening.restore(ab)
    assert not stiffening.restore(ab)
    assert model.geom_priority.tolist() == [0, 3, 0]
    assert model.geom_solref[0].tolist() == [0.02, 1.0]


def test_the_stretch_energy_has_mujocos_spring_force_as_its_gradient():
    model, data = ball_cloth(count=4).start()
    rng = np.random.default_rng(0)
    data.qpos[:12] += rng.normal(size=12) * 0.01
    data.qvel[:] = 0
    mujoco.mj_forward(model, data)
    books, step = Books(model), 1e-6

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
