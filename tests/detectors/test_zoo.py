"""Every detector of the table keeps the shared contract."""

import dataclasses

import numpy as np
import pytest

from tauguard.detectors import ArmModel
from tauguard.detectors.thresholded import Thresholded
from tauguard.detectors.zoo import DETECTORS, make_detector


@pytest.fixture(scope="module")
def arm(robot, drive_gain):
    return ArmModel(robot, drive_gain)


@pytest.fixture(scope="module", params=sorted(DETECTORS))
def fitted(request, training, arm):
    return make_detector(request.param).fit(training, arm)


def first(trace, rows):
    tables = ("t", "q", "qd", "current", "q_des", "qd_des", "qdd_des")
    cut = {name: getattr(trace, name)[:rows] for name in tables}
    return dataclasses.replace(trace, **cut, truth=None)


def test_the_table_names_its_detectors():
    for name in DETECTORS:
        detector = make_detector(name)
        assert detector.name == name
    with pytest.raises(ValueError, match="did you mean 'srq-svr'"):
        make_detector("srq-svm")


def test_scores_are_finite_causal_and_higher_in_hard_collisions(fitted, unseen):
    trace = unseen[0]
    score = fitted.scores(trace)
    assert score.shape == trace.t.shape
    assert np.isfinite(score).all()
    rows = 9_000
    np.testing.assert_allclose(fitted.scores(first(trace, rows)), score[:rows], rtol=0, atol=1e-9)
    hard = [c for c in trace.truth.collisions if c.peak_tau > 32]
    assert hard
    free = np.ones(len(score), bool)
    free[trace.t < fitted.settle] = False
    for c in trace.truth.collisions:
        free[(trace.t >= c.onset) & (trace.t < c.end + 1.0)] = False
    usual = np.quantile(score[free], 0.9)
    inside = [score[(trace.t >= c.onset) & (trace.t < c.end + 0.1)].max() for c in hard]
    assert np.mean(np.array(inside) > usual) > 0.7


def test_no_alarm_before_it_has_settled_and_levels_say_when(fitted, unseen):
    trace = first(unseen[0], 8_000)
    watched = Thresholded(fitted, -np.inf)
    found = watched.detect(trace)
    begin = fitted.settle + 0.002
    assert found.alarms[0].start == pytest.approx(begin, abs=1e-9)
    level = watched.levels(trace)
    np.testing.assert_array_equal(level > -np.inf, found.alarm)
    middle = float(np.median(level[found.alarm]))
    again = Thresholded(fitted, middle).detect(trace)
    np.testing.assert_array_equal(level > middle, again.alarm)


def test_foreign_traces_are_refused(fitted, unseen):
    slow = first(unseen[0], 4_000)
    slow = dataclasses.replace(slow, t=slow.t * 10)
    with pytest.raises(ValueError, match="sample every 10 ms"):
        fitted.scores(slow)


def test_an_unfitted_detector_says_so(unseen, training, arm):
    for name in DETECTORS:
        with pytest.raises(ValueError, match="not fitted"):
            make_detector(name).scores(unseen[0])
        with pytest.raises(ValueError, match="no traces"):
            make_detector(name).fit([], arm)
