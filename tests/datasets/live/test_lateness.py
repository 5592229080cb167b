"""Samples that come late, by the robot's clock against this machine's."""

import numpy as np
import pytest

from tauguard.datasets.live.lateness import Lateness, most_behind
from tauguard.datasets.live.listening import told_late
from tauguard.datasets.live.packets import Fault, Packets
from tauguard.detectors.faults.monitor import COLLISION, FAULT, FREE, Answer
from tauguard.traces import Trace

DT = 2e-3


def lateness(t, arrived):
    clock = Lateness()
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


def test_a_clock_that_begins_anew_is_not_late(t):
    stamps = np.where(t < 30, t, t - 30)
    assert lateness(stamps, t).max() < 1e-6
    assert lateness(np.where(t == t[5], np.nan, t), t).max() < 1e-6


def test_two_samples_and_a_half_or_20_ms():
    assert most_behind(2e-3) == 20e-3
    assert most_behind(8e-3) == 20e-3
    assert most_behind(40e-3) == 0.1


def test_a_late_answer_is_never_free_and_keeps_a_collision():
    free, hit = Answer(FREE, False, 0.5, ""), Answer(COLLISION, True, 2.0, "")
    assert told_late(free, 0.3).state == FAULT
    assert told_late(free, 0.3).reason == "late: the samples are 300 ms behind the robot"
    assert told_late(hit, 0.3).state == COLLISION
    named = Answer(FAULT, False, 0.5, "frozen: no signal has changed")
    assert told_late(named, 0.3) is named
