"""Which of the logs told to be free of contacts is not like the others."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.detectors import ArmModel
from tauguard.detectors.calibration.recording import Recording
from tauguard.detectors.evaluation.cross_validation import (
    CrossValidatedLog,
    cross_validate,
    judge_logs,
    standing_out,
)
from tauguard.traces import Alarm
from tests.detectors.synthetic_arm import GAIN, nominal, record
from tests.oracles.added_contact import Added, add_contact

ARM = ArmModel(nominal(), GAIN)
PUSHES = (3.0, 5.5, 12.0, 15.0, 18.0, 21.0)


def pushed(seed, starts=PUSHES):
    trace = record(seed)
    for start in starts:
        trace = add_contact(trace, GAIN, Added(start, 0.4, (14.0, -18.0, 9.0), "push"))
    return Recording(trace)


@pytest.fixture(scope="module")
def free():
    return {f"log{seed}": Recording(record(seed)) for seed in range(4)}


@pytest.fixture(scope="module")
def sifted(free):
    return cross_validate({**free, "pushed": pushed(9)}, ARM)


def test_a_log_full_of_pushes_is_left_out_with_their_seconds(sifted):
    (log,) = sifted.left_out
    assert log.name == "pushed"
    starts = np.array([alarm.start for alarm in log.alarms])
    assert len(starts) >= len(PUSHES) - 1
    late = np.abs(starts[:, None] - np.array(PUSHES)).min(axis=1)
    assert (late < 0.5).all()
    assert not log.throughout


def test_free_logs_are_kept_and_judged_without_the_odd_one(sifted, free):
    assert [log.name for log in sifted.kept] == list(free)
    assert not any(log.alarms for log in sifted.kept)


def test_a_log_that_is_vouched_for_is_kept_and_said(free):
    found = cross_validate({**free, "pushed": pushed(9)}, ARM, accepted=["pushed"])
    assert not found.left_out
    assert [log.name for log in found.accepted] == ["pushed"]


def test_a_load_that_nobody_told_differs_throughout(free):
    logs = judge_logs({**free, "laden": Recording(record(9, load=3.0))}, ARM)
    assert [log.name for log in logs if log.throughout] == ["laden"]


def test_one_log_is_judged_part_by_part():
    (log,) = judge_logs({"one": Recording(record(1, seconds=60.0))}, ARM)
    assert log.seconds == pytest.approx(60, abs=0.1)
    assert log.alarms == ()


def test_logs_too_short_to_be_left_out_are_judged_by_the_calibration_of_all():
    short = {"a": Recording(record(1, 6.0)), "b": Recording(record(2, 6.0))}
    assert [(log.name, log.alarms) for log in judge_logs(short, ARM)] == [("a", ()), ("b", ())]
    pushed = add_contact(short["a"].trace, GAIN, Added(3.0, 0.5, (30.0, -40.0, 20.0), "push"))
    first, second = judge_logs(short | {"a": Recording(pushed)}, ARM)
    assert [round(alarm.start) for alarm in first.alarms] == [3]
    assert second.alarms == ()
    with pytest.raises(ValueError, match="6 s of motion"):
        judge_logs({"a": short["a"]}, ARM)
    assert standing_out([]) == []


def log(name, seconds, alarms):
    return CrossValidatedLog(
        name, 0.0, seconds, tuple(Alarm(float(k), k + 0.1) for k in range(alarms)), 0.1
    )


@pytest.mark.parametrize(
    ("counts", "odd"),
    [
        ([0, 0, 0, 0, 0, 7], ["log5"]),  # a UR5's pushes among its free logs
        ([0, 0, 0, 3], []),  # a UR3's free logs
        ([2, 2, 2, 2], []),
        ([9, 0, 0, 9, 0, 0, 0], ["log0", "log3"]),
        ([0, 0], []),
    ],
)
def test_a_log_stands_out_by_its_alarms_for_its_length(counts, odd):
    logs = [log(f"log{k}", 30.0, count) for k, count in enumerate(counts)]
    assert sorted(one.name for one in standing_out(logs)) == odd


@settings(deadline=None)
@given(st.lists(st.tuples(st.floats(5.0, 500.0), st.integers(0, 20)), min_size=2, max_size=8))
def test_a_log_without_alarms_never_stands_out(drawn):
    logs = [log(f"log{k}", seconds, count) for k, (seconds, count) in enumerate(drawn)]
    assert all(one.alarms for one in standing_out(logs))
