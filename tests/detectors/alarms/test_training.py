"""A learned alarm beside free motion: what its threshold comes from."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from tauguard.detectors import ArmModel, gravity_torque
from tauguard.detectors.alarms.training import train_beside
from tauguard.detectors.calibration.identification import identify
from tauguard.detectors.calibration.recording import Recording
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
    return (*train_beside(method, [], logs, arm, 10.0), method.seen, arm)


@pytest.mark.parametrize(("count", "factor"), [(2, 20 / 3), (4, 4.0)])
def test_a_log_is_scored_by_a_detector_and_an_arm_model_made_without_it(count, factor):
    logs = [record(seed) for seed in range(count)]
    alarm, scores, seen, whole = trained(logs)
    assert len(scores) == count
    # Beyond all logs, the more the fewer they are; free motion's thresholds take the floor's place.
    assert alarm.threshold >= factor * max(one.peak for one in scores) * (1 - 1e-12)
    assert alarm.floor is None
    *folds, (all_logs, last) = seen
    assert last is whole
    assert len(all_logs) == count
    # The arm carries 2 kg in log 1: whatever learned from log 1 has another arm model now.
    other = [*logs]
    other[1] = record(1, load=2.0)
    _, _, again, _ = trained(other)
    without = [k for k, (own, _) in enumerate(folds) if not any(one is logs[1] for one in own)]
    assert len(without) == 1

    poses = np.concatenate([log.q[::50] for log in logs])
    for k, ((_, arm), (_, changed)) in enumerate(zip(folds, again, strict=False)):
        gravity = gravity_torque(changed.robot, poses) - gravity_torque(arm.robot, poses)
        assert (np.abs(gravity).max() < 0.5) == (k in without), (k, np.abs(gravity).max())
