"""The study of the guarantee, on a pool that is too small to mean much and large enough to run."""

import dataclasses

import numpy as np

from studies.detection import conformal as study
from tauguard.models import Mismatch


class Loudness:
    """Trains on nothing: the size of the first joint's current."""

    name, settle, dt = "loudness", 0.5, 1e-3

    def scores(self, trace):
        return np.abs(trace.current[:, 0])


def test_rows_say_what_was_asked_and_counted():
    plan = dataclasses.replace(study.QUICK, seconds=4.0, asked=(600.0,), draws=5)
    (row,) = study.guarantee_rows([Loudness()], Mismatch(seed=3), plan, 2)
    assert row["detector"] == "loudness"
    counted = row["false_alarms_per_hour"]
    assert row["fresh_hours"] == counted["hours"]
    assert abs(counted["hours"] - plan.fresh * 4.0 / 3600) < 1e-3
    assert row["kept"] == (counted["low"] <= 600.0)
    assert 0 <= row["draws_kept"] <= 5


def test_episodes_are_drawn_alike_and_again_the_same():
    arm = Mismatch(seed=3)
    one, two = (list(study.episodes(1, 40, 10.0, arm)) for _ in range(2))
    assert one == two
    assert len({episode.seed for episode in one}) == 40
    assert all(10 <= e.speed <= 60 and 0 <= e.payload_g <= 4500 for e in one)
    assert {e.payload_g == 0 for e in one} == {True, False}


def test_a_rate_that_the_motion_cannot_guarantee_is_said_in_its_row():
    plan = dataclasses.replace(study.QUICK, seconds=4.0, asked=(1.0,), calibration=3, fresh=2)
    (row,) = study.guarantee_rows([Loudness()], Mismatch(seed=3), plan, 2)
    assert "3 episodes" in row["refused"]
    assert "kept" not in row
