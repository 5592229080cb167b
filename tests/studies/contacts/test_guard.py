"""The guard's study: scenes come from the seed alone; the referee, where the truth is clear."""

from contextlib import nullcontext

import mujoco
import numpy as np
import pytest
from matplotlib.figure import Figure

from studies.contacts import guard, play
from studies.contacts.deep import Deep
from studies.contacts.draws import FAMILIES, scenes
from studies.contacts.referee import Referee


@pytest.mark.parametrize("family", FAMILIES)
def test_the_same_seed_draws_the_same_scene_and_another_one_does_not(family):
    one, same = (next(scenes(family, 3, 1)) for _ in range(2))
    other = next(scenes(family, 4, 1))
    np.testing.assert_array_equal(one.qvel, same.qvel)
    np.testing.assert_array_equal(one.qpos, same.qpos)
    differs = one.qvel.shape != other.qvel.shape or not np.array_equal(one.qvel, other.qvel)
    assert differs or one.given != other.given


@pytest.mark.parametrize("family", ["plate", "chain", "cloth"])
def test_the_referee_sees_what_flies_through_with_contacts_off_and_nothing_that_turns_back(family):
    for scene in scenes(family, 1, 3):
        for back in (False, True):
            model, data = scene.start(scene.timestep)
            referee = Referee(model, data)
            model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
            if back:
                data.qvel[:] *= -1
            for _ in range(round(scene.seconds / scene.timestep) + 1):
                mujoco.mj_step(model, data)
                referee.look()
            assert referee.passed is not back


def test_the_referee_counts_energy():
    scene = next(scenes("pair", 1, 1))
    model, data = scene.start(1e-3)
    referee = Referee(model, data)
    data.qvel[:] *= 2
    mujoco.mj_step(model, data)
    referee.look()
    assert referee.energy == pytest.approx(4, rel=0.01)


def test_plain_steps_lose_what_guarded_steps_hold():
    lost = 0
    for scene in scenes("plate", 5, 12):
        lost += not play.played(scene, "plain", scene.timestep).held
        mine = play.played(scene, "guarded", scene.timestep)
        assert mine.held
        assert mine.energy < guard.ADDED
    assert lost > 2


def test_a_step_that_holds_by_luck_is_not_the_first_that_holds(monkeypatch):
    def played(scene, method, step, stiff):
        return play.Played(step in scene, False, False, False, 1.0, 1.0, 1.0, [0.0] * 3)

    monkeypatch.setattr(play, "played", played)

    def first(held):
        fine = play.fine_runs(held, (4.0, 3.0, 2.0, 1.0))
        return play.Line(1.0, 1.0, {}, fine).first

    assert first({4.0, 2.0}) == 2.0
    assert first({4.0, 3.0}) is None
    assert first({4.0, 1.0}) == 1.0


def test_a_study_that_was_stopped_goes_on_where_it_was(tmp_path, monkeypatch):
    def read(count):
        rows = play.lines("plate", 7, count, ["plain", "guarded"], (5e-4,), tmp_path)
        return [(line.timestep, line.runs["guarded"].velocity) for line in rows]

    whole = read(3)
    monkeypatch.setattr(play, "played", None)
    assert read(3) == whole
    assert read(2) == whole[:2]


def _seen(second, velocity):
    """Whether a ball and another body meet in a step of 10 ms without contacts."""
    options = '<option gravity="0 0 0" timestep="0.01"/>'
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco>{options}<worldbody><geom size=".1"/>{second}</worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    deep = Deep(model, data)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    data.qvel[0] = velocity
    mujoco.mj_step(model, data)
    deep.look(data)
    return bool(deep.passed)


@pytest.mark.parametrize(
    ("shape", "offset", "passes"),
    [
        ('size=".1"', 0.0, True),
        ('size=".1"', 0.005, True),  # cores of 3 mm each
        ('size=".1"', 0.007, False),
        ('type="box" size=".1 .2 .1"', 0.105, True),  # its core reaches to .103
        ('type="box" size=".1 .2 .1"', 0.11, False),
        ('type="capsule" size=".1 .2" euler="90 0 0"', 0.205, True),
        ('type="capsule" size=".1 .2" euler="90 0 0"', 0.207, False),
    ],
)
def test_the_referee_sees_cores_that_meet_between_two_looks(shape, offset, passes):
    body = f'<body pos="1 {offset} 0"><freejoint/><geom {shape}/></body>'
    assert _seen(body, -200.0) is passes


@pytest.mark.parametrize(("turn", "passes"), [(0.0, False), (400.0, False), (500.0, True)])
def test_the_referee_counts_whole_turns(turn, passes):
    """A rod reaches the ball at 4.7 rad; 5 rad look at both ends like 1.3 the other way."""
    rod = """<body pos="1 0 0"><joint axis="0 0 1"/>
      <geom type="capsule" fromto="0 0 0 0 -1 0" size=".01"/></body>"""
    assert _seen(rod, turn) is passes


def test_the_study_draws_what_it_has():
    rows = guard._family_rows("plate", 0, 2, quick=True)
    assert {r["method"] for r in rows} == {"plain", "speculative", "guarded"}
    figure = Figure()
    guard.draw(rows, figure)
    assert len(figure.axes) == 2


def test_plain_steps_that_diverge_warn_nobody(tmp_path, monkeypatch):
    """Who listens to MuJoCo's warnings, as dm_control does, hears none and listens after."""
    monkeypatch.chdir(tmp_path)
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>"
    )
    heard: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(heard.append)
    try:
        for quiet in (True, False):
            data = mujoco.MjData(model)
            data.qvel[:] = np.inf
            with play.unwarned() if quiet else nullcontext():
                mujoco.mj_step(model, data)
            assert data.warning[mujoco.mjtWarning.mjWARN_BADQVEL].number > 0
            assert bool(heard) != quiet
            assert not list(tmp_path.iterdir())
    finally:
        mujoco.set_mju_user_warning(before)
