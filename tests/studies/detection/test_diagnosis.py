from dataclasses import replace

import numpy as np
import pytest

from studies.detection import diagnosis
from studies.detection.diagnosis import Judged
from studies.detection.diagnosis_pool import contact_kind, first_alarm
from studies.detection.fleet import Training
from tauguard.detectors import Diagnosis
from tauguard.detectors.diagnosis.classification import Signs
from tauguard.detectors.diagnosis.diagnosis_metrics import ContactErrors
from tauguard.detectors.diagnosis.severity import Interval90, Severity
from tauguard.traces import Alarm, Collision, Trace, Truth

T = np.arange(0, 2, 1e-3)


def collision(kind="strike", link=3, peak=20.0):
    return Collision(kind, 0.5, 0.55, link, np.array([0.1, 0, 0]), np.array([50.0, 0, 0]), peak)


def trace(pressed):
    """A trace in which a contact presses while ``pressed`` is True, with 10 N at (0.2, 0, 0)."""
    zero = np.zeros((len(T), 1))
    vector = np.outer(pressed, [10.0, 0, 0])
    point = np.where(pressed[:, None], [0.2, 0, 0], np.nan)
    truth = Truth(zero, vector[:, 0], (), zero[:, 0], pressed.astype(np.int64), point, vector)
    return Trace(("j",), T, zero, zero, zero, truth=truth)


def judged(link=3, said=3, kind="impact", called="impact", force=50.0, **event):
    alarm = Alarm(0.51, 0.6)
    signs = Signs(0.0, 0.0, 1.4, 0.1, 1e4, 1.0, 0.1)
    size = Severity(Interval90(1.0, 0.9, 1.2), Interval90(70, 60, 400), None)
    found = Diagnosis(
        *(alarm, said, np.ones(6) / 6, 1, 0.52, np.zeros(3), np.zeros(3), called, {}, signs),
        *(size, 0.8, ()),
    )
    errors = ContactErrors.of([force, 0, 0], np.zeros(3), ([50.0, 0, 0], np.array([0.1, 0, 0])))
    methods = diagnosis.METHODS
    links, each = dict.fromkeys(methods, said), dict.fromkeys(methods, errors)
    return replace(Judged(kind, 30.0, collision(link=link), 0.0, found, links, each), **event)


def test_links_are_counted_with_their_neighbours():
    rows = diagnosis.link_rows([judged(3, 3), judged(3, 4), judged(3, 6), judged(5, 5)])
    row = next(r for r in rows if r["group"] == "all" and r["method"] == "usual")
    assert (row["link_right"]["value"], row["link_right"]["n"]) == (0.5, 4)
    assert row["link_or_neighbour"]["value"] == 0.75
    table = diagnosis.confusion_rows([judged(3, 3), judged(3, 4), judged(2, 0)])
    third = next(r for r in table if r["link"] == 3)
    assert (third["said_3"], third["said_4"], third["said_none"]) == (1, 1, 0)


def test_errors_are_those_of_the_group():
    rows = diagnosis.contact_rows([judged(force=40.0), judged(force=20.0, speed=60.0)])
    row = next(r for r in rows if r["group"] == "60 %")
    assert (row["true_force_n"], row["force_error_n"], row["direction_deg"]) == (50.0, 30.0, 0.0)
    assert row["point_cm"] == pytest.approx(10.0)
    assert rows[0]["n"] == 2
    assert rows[0]["force_error_n"] == pytest.approx(20.0)


def test_a_payload_that_is_called_a_collision_is_counted():
    load = {"kind": "payload", "collision": None, "mass": 1.5}
    some = [
        judged(called="payload", **load),
        judged(called="impact", **load),
        replace(judged(**load), diagnosis=None),
    ]
    row = diagnosis.payload_rows(some)[0]
    assert row["alarm_raised"]["value"] == pytest.approx(2 / 3)
    assert row["called_collision"]["value"] == 0.5
    assert row["mass_error_g"] == pytest.approx(100.0)
    kinds = {r["kind"]: r for r in diagnosis.kind_rows(some)}
    assert kinds["payload"]["said_impact"] == 1
    assert kinds["clamp"]["kind_right"]["n"] == 0


def test_a_clamping_must_still_press_at_the_end_of_the_look():
    alarm = Alarm(0.51, 0.6)
    assert contact_kind(trace(T > 0.5), collision("clamp"), alarm) == "clamp"
    assert contact_kind(trace((T > 0.5) & (T < 0.7)), collision("clamp"), alarm) == "impact"
    assert contact_kind(trace(T > 0.5), collision("strike"), alarm) == "impact"
    assert first_alarm([Alarm(0.4, 0.6), Alarm(0.7, 0.8)], collision()) == Alarm(0.7, 0.8)
    assert first_alarm([Alarm(1.4, 1.6)], collision()) is None


def test_a_small_run_fills_every_table(monkeypatch):
    size = diagnosis.Size(1, (30.0,), Training(1, 2, 3, 12.0), 0.004, 1, 1, 1)
    monkeypatch.setattr(diagnosis, "QUICK", size)
    rows = diagnosis.measure(True, 3)
    studies = {row["study"] for row in rows}
    assert studies == set(diagnosis.NOTES)
    assert {row["method"] for row in rows if row["study"] == "link"} == set(diagnosis.METHODS)
    assert all(
        row["point_cm"] < 200 and row["force_error_n"] >= 0
        for row in rows
        if row["study"] == "contact"
    )
