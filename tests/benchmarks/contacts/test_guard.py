"""The guard's study: scenes come from the seed alone; the referee, where the truth is clear."""

import mujoco
import numpy as np
import pytest
from matplotlib.figure import Figure

from tauguard.benchmarks.contacts import guard
from tauguard.benchmarks.contacts.draws import FAMILIES, scenes
from tauguard.benchmarks.contacts.referee import Referee


@pytest.mark.parametrize("family", FAMILIES)
def test_the_same_seed_draws_the_same_scene_and_another_one_does_not(family):
    one, same = (next(scenes(family, 3, 1)) for _ in range(2))
    other = next(scenes(family, 4, 1))
    np.testing.assert_array_equal(one.qvel, same.qvel)
    np.testing.assert_array_equal(one.qpos, same.qpos)
    assert one.qvel.shape != other.qvel.shape or not np.array_equal(one.qvel, other.qvel)


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
        lost += not guard.played(scene, "plain", scene.timestep).held
        mine = guard.played(scene, "guarded", scene.timestep)
        assert mine.held
        assert mine.energy < guard.ADDED
    assert lost > 2


def test_a_step_that_holds_by_luck_is_not_the_first_that_holds(monkeypatch):
    def play(scene, method, step, stiff):
        return guard.Played(step in scene, False, False, 1.0, 1.0, 1.0, np.zeros(3))

    monkeypatch.setattr(guard, "played", play)
    fixed = (4.0, 3.0, 2.0, 1.0)
    assert guard._first(guard._fine({4.0, 2.0, 1.0}, fixed)) == 2.0
    assert guard._first(guard._fine({4.0, 3.0}, fixed)) is None


def test_the_study_draws_what_it_has():
    rows = guard._family_rows("plate", 0, 2, quick=True)
    assert {r["method"] for r in rows} == {"plain", "speculative", "guarded"}
    figure = Figure()
    guard.draw(rows, figure)
    assert len(figure.axes) == 2
