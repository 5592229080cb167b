"""A learned alarm beside free motion: what its threshold comes from."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from tauguard.detectors import ArmModel, gravity_torque
from tauguard.detectors.alarms.training import train_beside
from tauguard.detectors.calibration.identification import identify
from tauguard.detectors.calibration.recording import Recording, cut
from tauguard.detectors.scores.baselines import MovingThresholds
from tests.detectors.synthetic_arm import GAIN, nominal, record


@dataclass
class Watched:
    """A method that keeps what it is trained with."""

    seen: list = field(default_factory=list)
    name: str = "watched"

    def fit(self, traces, arm):
        self.seen.append((list(traces), arm))
        return MovingThresholds().fit(traces, arm)


def trained(logs):
    arm = identify(ArmModel(nominal(), GAIN), [Recording(log) for log in logs]).arm
    method = Watched()
    named = {f"log{k}": log for k, log in enumerate(logs)}
    return (*train_beside(method, [], named, arm, 10.0), method.seen, arm)


@pytest.mark.parametrize(("count", "factor"), [(2, 20 / 3), (4, 4.0)])
def test_a_log_is_scored_by_a_detector_and_an_arm_model_made_without_it(count, factor):
    logs = [record(seed) for seed in range(count)]
    alarm, scores, notes, seen, whole = trained(logs)
    assert len(scores) == count
    (note,) = (finding.text for finding in notes)
    assert f"is {factor:.2g} times the highest score of {count} logs" in note
    # Beyond all logs, the more the fewer they are; free motion's thresholds take the floor's place.
    assert alarm.threshold >= factor * max(one.peak for one in scores) * (1 - 1e-12)
    assert alarm.floor is None
    *folds, (all_logs, last) = seen
    assert last is whole
    assert len(all_logs) == count
    # The arm carries 2 kg in log 1: whatever learned from log 1 has another arm model now.
    other = [*logs]
    other[1] = record(1, load=2.0)
    *_, again, _ = trained(other)
    without = [k for k, (own, _) in enumerate(folds) if not any(one is logs[1] for one in own)]
    assert len(without) == 1

    poses = np.concatenate([log.q[::50] for log in logs])
    for k, ((_, arm), (_, changed)) in enumerate(zip(folds, again, strict=False)):
        gravity = gravity_torque(changed.robot, poses) - gravity_torque(arm.robot, poses)
        assert (np.abs(gravity).max() < 0.5) == (k in without), (k, np.abs(gravity).max())


def test_a_log_without_which_the_others_are_too_short_is_named():
    long, short = record(0), cut(record(1), slice(0, 700))
    _, _, notes, seen, whole = trained([long, short])
    note, floor = (finding.text for finding in notes)
    assert note.startswith("log0: scored by the arm model calibrated with it")
    assert "because the rest has 7.0 s of motion" in note
    assert seen[0][1] is whole
    assert seen[1][1] is not whole
    assert "6.7 times the highest score of 2 logs" in floor


def test_halves_of_one_log_count_as_two():
    *_, notes, _, _ = trained([record(0)])
    assert "times the highest score of 2 halves of a log" in notes[-1].text


@pytest.mark.parametrize("count", [0, 2])
def test_logs_in_which_no_joint_moves_are_scored_too(count):
    logs = [record(seed) for seed in range(count)]
    logs += [cut(record(seed, dwell=(8.0, 20.0)), slice(950, 1850)) for seed in (7, 8)]
    whole = identify(ArmModel(nominal(), GAIN), [Recording(record(0))]).arm
    named = {f"log{k}": log for k, log in enumerate(logs)}
    _, scores, notes = train_beside(Watched(), [], named, whole, 10.0)
    assert len(scores) == len(logs)
    assert any("the rest has 0.0 s of motion" in note.text for note in notes) == (count == 0)


def test_other_errors_of_the_calibration_are_not_hidden(monkeypatch):
    def fail(*_, **__):
        raise ValueError("another error")

    monkeypatch.setattr("tauguard.detectors.calibration.identification._fit", fail)
    arm, logs = ArmModel(nominal(), GAIN), {f"log{k}": record(k) for k in range(2)}
    with pytest.raises(ValueError, match="another error"):
        train_beside(Watched(), [], logs, arm, 10.0)


def test_many_logs_leave_the_threshold_to_the_rate():
    """The highest of 19 logs and more is no reason for a factor."""
    logs = [cut(record(k), slice(s, s + 400)) for k in range(5) for s in (100, 1100, 1500, 2000)]
    _, scores, notes, _, _ = trained(logs)
    assert len(scores) == 20
    assert not any("few logs" in note.text for note in notes)
