"""What the demo prints of false alarms: what was asked for beside what was found."""

import numpy as np

from tauguard.cli.demo import FALSE_ALARMS_PER_HOUR, false_alarm_text, requested
from tauguard.detectors import poisson_rate
from tauguard.detectors.thresholds.free_scores import FreeScores
from tauguard.detectors.thresholds.tail_model import threshold_for_rate


def test_the_rate_that_was_asked_stands_beside_the_one_that_was_found():
    rng = np.random.default_rng(0)
    scores = [FreeScores(rng.exponential(size=3000), np.ones(3000), 60.0) for _ in range(5)]

    class Alarm:
        threshold = threshold_for_rate(scores, FALSE_ALARMS_PER_HOUR)

    wanted = requested(Alarm(), scores)
    assert wanted["low"] <= FALSE_ALARMS_PER_HOUR <= wanted["high"]
    found = poisson_rate(3, 0.2)
    said = false_alarm_text({"asked": wanted, "false_alarms_per_hour": found})
    assert "requested 1, found 15.0" in said
    assert "from 3 alarms in 12 min" in said
    assert "5 min of training motion" in said
