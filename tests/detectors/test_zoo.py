"""Every detector of the table keeps the shared contract."""

import dataclasses

import numpy as np
import pytest

from tauguard.detectors import ArmModel, CollisionDetector, calibrate, front_end, pipeline
from tauguard.detectors.calibrate import free_rows
from tauguard.detectors.thresholded import Thresholded
from tauguard.detectors.zoo import DETECTORS, make_detector
from tauguard.traces import Trace


@pytest.fixture(scope="module")
def arm(robot, drive_gain):
    return ArmModel(robot, drive_gain)


SMALLER = {
    "windows": 2000,
    "mined": 200,
    "epochs": 25,
    "rows": 10_000,
    "trees": 20,
}


def small(name):
    """The detector with less training, so that the tests are quick."""
    detector = make_detector(name)
    if name.startswith("srq-svr"):
        settings = detector.chain.settings
        less = dataclasses.replace(settings, windows=800, mined=min(settings.mined, 100))
        detector.chain = CollisionDetector(less)
    for field, value in SMALLER.items():
        if hasattr(detector, field):
            setattr(detector, field, value)
    return detector


@pytest.fixture(scope="module")
def identified(training, arm):
    """One identification for all: what it finds is tested where it belongs."""
    return calibrate(arm, training[::2])


@pytest.fixture(scope="module", params=list(DETECTORS))
def fitted(request, training, arm, identified):
    with pytest.MonkeyPatch.context() as patch:
        for module in (front_end, pipeline):
            patch.setattr(module, "calibrate", lambda *_, **__: identified)
        return small(request.param).fit(training[::2], arm)


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


def test_scores_are_finite_and_causal(fitted, unseen):
    trace = first(unseen[0], 12_000)
    score = fitted.scores(trace)
    assert score.shape == trace.t.shape
    assert np.isfinite(score).all()
    rows = 9_000
    np.testing.assert_allclose(fitted.scores(first(trace, rows)), score[:rows], rtol=0, atol=1e-9)


def test_hard_collisions_score_above_free_motion(fitted, unseen):
    if fitted.name == "srq-svr-plain":
        pytest.skip("its kernel is almost diagonal on raw residuals: it ranks nothing")
    free, inside = [], []
    for trace in unseen:
        score = fitted.scores(trace)
        quiet = free_rows(trace, fitted.settle)
        free.append(score[quiet])
        hard = [c for c in trace.truth.collisions if c.peak_tau > 16]
        inside += [score[(trace.t >= c.onset) & (trace.t < c.end + 0.1)].max() for c in hard]
    assert len(inside) >= 5
    # An untold payload is a residual for the form without past currents.
    least = 0.4 if fitted.name == "current-network-static" else 0.7
    assert np.mean(np.array(inside) > np.quantile(np.concatenate(free), 0.98)) >= least


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
    trace = first(unseen[0], 4_000)
    with pytest.raises(ValueError, match="sample every 10 ms"):
        fitted.scores(dataclasses.replace(trace, t=trace.t * 10))
    tables = ("q", "qd", "current")
    fewer = {name: getattr(trace, name)[:, :3] for name in tables}
    other = Trace(trace.joint_names[:3], trace.t, **fewer)
    with pytest.raises(ValueError, match="3 joints"):
        fitted.scores(other)


def test_an_unfitted_detector_says_so(unseen, training, arm):
    for name in DETECTORS:
        with pytest.raises(ValueError, match="not fitted"):
            make_detector(name).scores(unseen[0])
        with pytest.raises(ValueError, match="no traces"):
            make_detector(name).fit([], arm)
