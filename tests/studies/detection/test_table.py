"""The detection study's printed form, on rows whose answer is known by hand."""

from __future__ import annotations

import pytest

from studies.detection.rows import DISSERTATION
from studies.detection.table import headline, shown
from tauguard.detectors.evaluation.metrics import wilson
from tauguard.report import table


def cell(name: str, speed: float, point: float, hits: int, quiet: int) -> dict[str, object]:
    return {
        "study": "speed",
        "detector": name,
        "speed": speed,
        "threshold_a": point,
        "threshold": 1.0,
        "threshold_low": 0.5,
        "threshold_high": 2.0,
        "sensitivity": wilson(hits, 100),
        "specificity": wilson(quiet, 100),
    }


def theirs(speed: float, point: float) -> dict[str, object]:
    tp, fn, fp, tn = DISSERTATION[speed][0 if point == 1.6 else 2]
    return {
        "study": "dissertation",
        "detector": "srq-svr",
        "speed": speed,
        "threshold_a": point,
        "their_sensitivity": wilson(tp, tp + fn),
        "their_specificity": wilson(tn, tn + fp),
    }


@pytest.fixture
def rows():
    cells = [
        cell("srq-svr", 10.0, 1.6, 100, 98),
        cell("srq-svr", 60.0, 2.0, 99, 93),  # the dissertation: 59/65 = .908, 166/178 = .933
        cell("other", 10.0, 1.6, 99, 99),
        cell("other", 60.0, 2.0, 98, 98),
        cell("srq-svr-plain", 10.0, 1.6, 40, 90),
        cell("srq-svr-plain", 60.0, 2.0, 30, 90),
    ]
    return [*cells, theirs(10.0, 1.6), theirs(60.0, 2.0)]


def test_the_headline_has_one_best_detector_and_says_where_the_goal_is_met(rows):
    first, second = headline(rows)
    assert (first["best"], second["best"]) == ("other", "other")  # its worst rate is .98, not .93
    assert first["met"] is True
    assert second["met"] is False  # SVR-SRQ's .93 lies below the dissertation's .933
    assert (first["plain_sensitivity"], second["svr_specificity"]) == (0.4, 0.93)
    assert second["dissertation_specificity"] == pytest.approx(166 / 178)


def test_a_best_detector_below_98_percent_does_not_meet_the_goal(rows):
    worse = [r for r in rows if r["detector"] != "other"] + [
        cell("other", 10.0, 1.6, 97, 100),
        cell("other", 60.0, 2.0, 100, 100),
    ]
    assert [row["met"] for row in headline(worse)] == [False, False]


def test_cells_are_printed_with_speeds_as_columns_and_the_headline_last(rows):
    more = rows + headline(rows)
    printed = shown(more)
    assert [r["study"] for r in printed[-2:]] == ["headline", "headline"]
    own = next(r for r in printed if r["study"] == "speed" and r["detector"] == "other")
    assert own["10 %"] == "0.990 / 0.990"
    assert "0.990 / 0.990" in table(printed)
    assert len(more) == len(rows) + 2  # what is written as JSON is not shortened


def test_strata_are_summed_over_speeds():
    rows = [
        {
            "study": "strata",
            "detector": "a",
            "point": "hourly",
            "speed": speed,
            "torque_nm": kind,
            "sensitivity": wilson(hits, 13),
        }
        for speed, kind, hits in ((10.0, "16-32", 13), (10.0, "4-8", 2), (60.0, "4-8", 11))
    ]
    together, *each = shown(rows)
    assert (together["4-8"], together["16-32"]) == ("13/26", "13/13")
    assert list(together)[-2:] == ["4-8", "16-32"]
    assert [r["4-8"] for r in each] == ["2/13", "11/13"]
