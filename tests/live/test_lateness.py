"""Samples that come late, by the robot's clock against this machine's."""

import numpy as np
import pytest

from tauguard.detectors.alarms.monitor import COLLISION, FAULT, FREE, Answer
from tauguard.live.lateness import Lateness, late_answer, most_behind
from tauguard.live.packets import Fault, Packets
from tauguard.traces import Trace

DT = 2e-3
FREE_ANSWER = Answer(FREE, False, 0.5, "")
BACK = Answer(FAULT, False, 0.5, "time: the time goes back by 0.002 s")


def lateness(t, arrived):
    clock = Lateness(DT)
    return np.array([clock.step(float(a), float(b)) for a, b in zip(t, arrived, strict=True)])


@pytest.fixture(scope="module")
def t():
    return np.arange(0, 60, DT)


def test_a_burst_is_as_late_as_its_oldest_sample(t):
    still = np.zeros((len(t), 2))
    trace = Trace(("a", "b"), t, still, still, still)
    packets = Fault("late", 10.0, 0.5).apply(Packets.of(trace))
    late = lateness(packets.t, packets.due + 123.0)
    first = int(np.argmax(late > most_behind(DT)))
    assert t[first] == pytest.approx(10.0)  # with the first sample of the burst
    assert late[first] == pytest.approx(0.498, abs=1e-3)  # less what clocks may run apart
    assert (late[t >= 10.5] < 1e-6).all()


def test_jitter_and_clocks_that_run_apart_are_not_late(t):
    jitter = np.random.default_rng(0).uniform(0, 5e-3, len(t))
    for drift in (-1e-4, 0.0, 1e-4):
        assert lateness(t, (1 + drift) * t + jitter).max() < most_behind(DT)


def test_one_stale_time_stamp_erases_no_backlog():
    clock = Lateness(DT)
    t = np.arange(0, 2, DT)
    behind = np.where(t < 0.5, 0.0, 0.3)
    stamps = t.copy()
    stamps[700] = t[698]
    answers = [
        clock.judge(BACK if k == 700 else FREE_ANSWER, float(stamps[k]), float(t[k] + behind[k]))
        for k in range(len(t))
    ]
    assert answers[700] is BACK
    assert {a.state for a, late in zip(answers, behind, strict=True) if not late} == {FREE}
    assert {a.state for a, late in zip(answers, behind, strict=True) if late} == {FAULT}
    assert answers[-1].reason == "late: the samples are 300 ms behind the robot"


def test_a_time_that_is_no_number_changes_nothing():
    clock = Lateness(DT)
    bad = Answer(FAULT, False, 0.5, "not-finite: the time is nan")
    assert clock.judge(FREE_ANSWER, 1.0, 1.0) is FREE_ANSWER
    assert clock.judge(bad, np.nan, 1.002) is bad
    assert clock.judge(FREE_ANSWER, 1.004, 1.3).state == FAULT


def test_a_clock_that_begins_anew_is_not_late(t):
    stamps = np.where(t < 30, t, t - 30)
    assert lateness(stamps, t).max() < 1e-6


def test_a_delay_that_grows_more_slowly_than_the_clocks_may_is_not_seen():
    hour = np.arange(0, 3600, 1.0)
    assert lateness(hour, hour * (1 + 0.9e-4)).max() < 1e-6
    assert lateness(hour, hour * (1 + 5e-4)).max() > 1.0  # 1.8 s behind, of which 0.36 are allowed


def test_two_samples_and_a_half_or_20_ms():
    assert most_behind(2e-3) == 20e-3
    assert most_behind(8e-3) == 20e-3
    assert most_behind(40e-3) == 0.1


def test_a_late_answer_is_never_free_and_keeps_a_collision():
    assert late_answer(FREE_ANSWER, 0.3).state == FAULT
    assert late_answer(Answer(COLLISION, True, 2.0, ""), 0.3).state == COLLISION
    assert late_answer(FREE_ANSWER, 0.3).reason == "late: the samples are 300 ms behind the robot"
