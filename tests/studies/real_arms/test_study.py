"""The study of real arms counts alarms and pushes as it says."""

import numpy as np
import pytest

from studies.real_arms import arms, study
from tauguard.traces import Trace


def trace(seconds=10.0, dt=0.01):
    t = 5.0 + np.arange(0, seconds, dt)
    nothing = np.zeros((len(t), 2))
    return Trace(("a", "b"), t, nothing, nothing, nothing)


def test_says_so_where_there_are_no_logs(tmp_path, monkeypatch):
    monkeypatch.setenv("TAUGUARD_DATA", str(tmp_path))
    monkeypatch.setattr(study.trained_with, "rows", lambda quick, seed: [])
    (row,) = study.measure(quick=True, seed=0)
    assert "TAUGUARD_DATA" in row["log"]


def test_a_push_is_found_from_just_before_its_start_to_its_peak():
    log = trace()
    up = np.zeros(len(log.t), dtype=bool)
    for start in (1.9, 3.3, 6.0):
        up[round(start / 0.01) : round(start / 0.01) + 10] = True
    known = (arms.Push(2.0, 2.3, True), arms.Push(3.0, 3.2, False), arms.Push(5.8, 6.1, False))
    tally = study.Tally()
    study.find(tally, lambda _: up, log, known, np.random.default_rng(0))
    assert tally.delays[True] == pytest.approx([-0.1])
    assert tally.delays[False] == pytest.approx([np.inf, 0.2])
    # Three alarms in 10 s; spans of 0.45, 0.35 and 0.45 s.
    assert tally.chance[True] == pytest.approx(3 * 0.45 / 10, abs=0.06)
    assert tally.chance[False] == pytest.approx(3 * 0.8 / 10, abs=0.12)


def test_false_alarms_are_bounded_by_the_exact_interval():
    tally = study.Tally()
    up = np.zeros(1000, dtype=bool)
    study.count(tally, "ours", lambda _: up, trace())
    assert tally.alarms == 0
    (row,) = study._rows("arm", "ours", tally)
    # Exact Poisson interval: no alarm in an hour bounds the rate at -ln(0.025).
    assert row["at most"] == pytest.approx(-np.log(0.025) * 3600 / tally.seconds)


@pytest.mark.data
def test_pushes_of_the_force_sensor(data_dir, monkeypatch):
    monkeypatch.setenv("TAUGUARD_DATA", str(data_dir))
    ur5 = next((arm for arm in arms.available() if arm.name == "ur5"), None)
    if ur5 is None:
        pytest.skip("no ur5 folder in the real data")
    found = arms.pushes(ur5, "no10_standing_force")
    assert len(found) == 8
    assert not any(push.moving for push in found)
    assert found[0].start == pytest.approx(4.82, abs=0.01)
