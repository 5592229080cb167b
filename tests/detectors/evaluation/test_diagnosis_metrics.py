import numpy as np
import pytest

from tauguard.detectors import Diagnosis, diagnosis_metrics
from tauguard.detectors.diagnosis.classification import Signs
from tauguard.detectors.diagnosis.severity import ContactTorque, Interval90, Severity
from tauguard.detectors.evaluation.diagnosis_metrics import (
    ContactErrors,
    TrueSeverity,
    contact_at,
    match_diagnoses,
)
from tauguard.traces import Alarm, Collision, Trace, Truth

T = np.arange(0, 3, 1e-3)
#: An impulse interval that holds 50 N for 21 ms, and a peak interval that does not hold 50 N.
SIZE = Severity(
    Interval90(1.0, 0.9, 1.2),
    Interval90(70, 60, 400),
    ContactTorque(0, 0.1, *np.ones((2, 1)), 1.0, 0.0),
)
SIGNS = Signs(0.0, 0.0, 0.0, np.inf, 1e3, 0.0, 0.1)


def collision(onset, link):
    return Collision("strike", onset, onset + 0.02, link, np.zeros(3), np.array([0, 0, 90.0]), 20.0)


def make(collisions):
    zero = np.zeros((len(T), 1))
    vector, point = np.zeros((len(T), 3)), np.full((len(T), 3), np.nan)
    for c in collisions:
        rows = (c.onset <= T) & (c.end >= T)
        vector[rows], point[rows] = [0, 30.0, 40.0], [0.1, 0.2, 0.3]
    link = (vector != 0).any(axis=1).astype(np.int64)
    truth = Truth(zero, link * 50.0, tuple(collisions), zero[:, 0], link, point, vector)
    return Trace(("j",), T, zero, zero, zero, truth=truth)


def said(start, link, kind="transient"):
    force, point = np.array([0, 30.0, 0]), np.array([0.1, 0.2, 0.4])
    alarm = Alarm(start, start + 0.1)
    return Diagnosis(
        *(alarm, link, np.ones(6) / 6, 1, start + 0.01, force, point, kind, {}, SIGNS),
        *(SIZE, start - 0.02, start + 0.3, ("j",)),
    )


def test_each_collision_is_judged_by_its_first_alarm_and_other_alarms_are_false():
    trace = make([collision(0.5, 3), collision(1.5, 4)])
    said_all = [said(0.505, 3), said(0.7, 6), said(1.2, 2, "payload"), said(1.51, 2), said(2.5, 1)]
    judged = match_diagnoses(said_all, trace)
    assert [j.collision and j.collision.link for j in judged] == [3, None, 4, None]
    found = diagnosis_metrics(judged)
    assert (found["link_right"]["value"], found["link_right"]["n"]) == (0.5, 2)
    assert found["link_or_neighbour"]["value"] == 0.5
    assert found["false_alarms_called_payload"]["value"] == 0.5
    assert found["force_error_n"]["median"] == pytest.approx(40.0)
    assert found["direction_deg"]["median"] == pytest.approx(np.degrees(np.arccos(0.6)))
    assert found["point_cm"]["median"] == pytest.approx(10.0)
    assert (found["impulse_held"]["value"], found["peak_held"]["value"]) == (1.0, 0.0)
    assert (found["impulse_identifiable"]["value"], found["peak_identifiable"]["value"]) == (1, 0)
    assert found["peak_width"]["median"] == pytest.approx(400 / 60)


def test_nothing_judged_is_none_and_not_a_crash():
    found = diagnosis_metrics(match_diagnoses([], make([])))
    assert found["link_right"]["value"] is None
    assert found["force_error_n"] == {"median": None, "p95": None, "n": 0}


def test_the_truth_behind_an_estimate_is_the_contact_just_before_it():
    trace = make([collision(0.5, 3)])
    force, point = contact_at(trace, trace.truth.collisions[0], 0.53)
    np.testing.assert_array_equal(force, [0, 30, 40])
    np.testing.assert_array_equal(point, [0.1, 0.2, 0.3])
    # Nothing touched then: the collision's peak.
    force, _ = contact_at(trace, trace.truth.collisions[0], 0.6)
    np.testing.assert_array_equal(force, [0, 0, 90])
    assert ContactErrors.of(np.zeros(3), point, (force, point)).direction == 90.0
    bare = Trace(("j",), T, *(np.zeros((len(T), 1)),) * 3)
    with pytest.raises(ValueError, match="no truth"):
        match_diagnoses([], bare)


def test_true_impulse_and_peak_end_with_the_look():
    trace = make([collision(0.5, 3)])
    whole = TrueSeverity.of(trace, trace.truth.collisions[0], 1.0)
    assert (whole.impulse, whole.peak) == pytest.approx((50 * 0.021, 50), rel=0.06)
    part = TrueSeverity.of(trace, trace.truth.collisions[0], 0.51)
    assert part.impulse == pytest.approx(0.5 * whole.impulse, rel=0.1)
