"""Thresholds from quiet seconds and thresholds for a rate."""

import numpy as np
import pytest

from tauguard.detectors import ArmModel, QuietDetector
from tauguard.detectors.evaluation.events import find_alarms
from tauguard.detectors.thresholds.quiet import QuietThresholds, still
from tauguard.detectors.thresholds.rates import block_peaks, sustained, threshold_for_rate


def test_still_means_slow_for_150_ms():
    qd = np.zeros((100, 1))
    qd[40] = 0.02
    rests = still(qd, 0.01)[:, 0]
    assert not rests[:14].any()
    assert rests[14:40].all()
    assert not rests[40:55].any()
    assert rests[55:].all()


def test_each_regime_has_its_own_threshold():
    qd = np.concatenate([np.zeros((100, 1)), np.ones((100, 1))])
    left = np.concatenate([np.full((100, 1), 2.0), np.full((100, 1), -1.0)])
    found = QuietThresholds.learn(left, qd, 0.01, factor=1.5)
    assert found.still[0] == pytest.approx(3.0)
    # the first 150 ms of standing count as moving: the borrowed larger value is honest
    assert found.moving[0] == pytest.approx(3.0)
    assert found.score(left, qd, 0.01).max() == pytest.approx(2 / 3)


def test_sustained_and_blocks():
    score = np.array([0, 1, 2, 3, 1, 5, 5, 5, 0.0])
    assert sustained(score, 3).tolist() == [-np.inf, -np.inf, 0, 1, 1, 1, 1, 5, 0]
    assert block_peaks(score, 4).tolist() == [3, 5, 0]


@pytest.mark.parametrize("per_hour", [3600.0, 600.0, 60.0])
def test_the_threshold_gives_no_more_alarms_than_asked(per_hour):
    rng = np.random.default_rng(0)
    dt, score = 0.01, rng.normal(size=200_000)
    threshold = threshold_for_rate([score], dt, per_hour)
    alarms = find_alarms(np.arange(len(score)) * dt, score > threshold)
    hours = len(score) * dt / 3600
    assert len(alarms) <= per_hour * hours
    if per_hour < 3600:
        assert len(alarms) >= 0.6 * per_hour * hours  # and not many fewer


def test_rates_below_one_alarm_extrapolate_the_tail():
    rng = np.random.default_rng(1)
    score = rng.exponential(size=400_000)
    threshold = threshold_for_rate([score[:40_000]], 0.01, 1.0)
    assert threshold > score[:40_000].max()
    # true rate: blocks of 50 samples, 7,200 an hour: 50 exp(-x) 7200 = 1
    assert threshold == pytest.approx(np.log(50 * 7200), rel=0.2)


def test_bad_rates():
    with pytest.raises(ValueError, match="per_hour: 0"):
        threshold_for_rate([np.zeros(10)], 1e-3, 0.0)
    with pytest.raises(ValueError, match="no collision-free scores"):
        threshold_for_rate([], 1e-3, 1.0)


def test_quiet_seconds_make_a_detector(unseen, detector):
    hits = found = 0
    for trace in unseen:
        quiet = QuietDetector(detector.arm, quiet=1.5, observer_gain=100.0, confirmation=3e-3)
        out = quiet.detect(trace)
        assert not out.alarm[trace.t <= trace.t[0] + 1.5].any()
        for c in trace.truth.collisions:
            if c.peak_tau > 30:
                hits += 1
                found += out.alarm[(trace.t >= c.onset) & (trace.t <= c.onset + 0.5)].any()
    assert found >= 0.8 * hits > 0


def test_a_trace_shorter_than_its_quiet_seconds_is_refused(unseen, robot, drive_gain):
    detector = QuietDetector(ArmModel(robot, drive_gain), quiet=1000.0)
    with pytest.raises(ValueError, match="all of it within the 1000 quiet seconds"):
        detector.detect(unseen[0])
