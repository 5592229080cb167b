"""What the demo prints of false alarms: what was asked for beside what was found."""

from types import SimpleNamespace

import numpy as np

from tauguard.cli.demo import FALSE_ALARMS_PER_HOUR, false_alarm_text, requested
from tauguard.detectors import Detector, poisson_rate
from tauguard.detectors.thresholds.free_scores import FreeScores
from tauguard.detectors.thresholds.tail_model import threshold_for_rate


def test_the_rate_that_was_asked_stands_beside_the_one_that_was_found():
    rng = np.random.default_rng(0)
    scores = [FreeScores(rng.exponential(size=3000), np.ones(3000), 60.0) for _ in range(5)]

    arm = SimpleNamespace(robot=SimpleNamespace(joint_names=("a",)))
    alarm = SimpleNamespace(
        threshold=threshold_for_rate(scores, FALSE_ALARMS_PER_HOUR),
        detector=SimpleNamespace(name="any", arm=arm, dt=0.01),
        confirmation=0.0,
        settle=0.5,
    )
    trained = Detector(alarm, scores=scores, false_alarms_per_hour=FALSE_ALARMS_PER_HOUR)
    wanted = requested(trained)
    assert wanted["low"] <= FALSE_ALARMS_PER_HOUR <= wanted["high"]
    found = poisson_rate(3, 0.2)
    said = false_alarm_text({"asked": wanted, "false_alarms_per_hour": found})
    assert "requested 1, found 15.0" in said
    assert "from 3 alarms in 12 min" in said
    assert "5 min of training motion" in said
