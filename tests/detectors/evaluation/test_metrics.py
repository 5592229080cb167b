"""Figures and their intervals against published values and other implementations."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from tauguard.detectors.evaluation.matching import (
    delay_metrics,
    detection_metrics,
    match,
    poisson_rate,
    wilson,
)
from tauguard.traces import stratum
from tauguard.traces.trace import Alarm, Collision


@given(st.integers(0, 300), st.integers(1, 300))
def test_wilson_equals_scipy(k, n):
    k = min(k, n)
    ours = wilson(k, n)
    theirs = stats.binomtest(k, n).proportion_ci(method="wilson")
    assert ours["value"] == k / n
    assert (ours["low"], ours["high"]) == pytest.approx((theirs.low, theirs.high), abs=1e-12)
    assert 0 <= ours["low"] <= ours["value"] <= ours["high"] <= 1


def test_wilson_of_the_dissertation_cell():
    cell = wilson(60, 65)
    assert (round(cell["low"], 2), round(cell["high"], 2)) == (0.83, 0.97)
    assert round(wilson(65, 65)["low"], 3) == 0.944


def test_nothing_tried_is_no_figure():
    assert wilson(0, 0) == {"value": None, "low": None, "high": None, "n": 0}
    assert poisson_rate(0, 0.0)["value"] is None
    assert delay_metrics([None])["median"] is None


@given(st.integers(0, 60), st.floats(0.1, 20))
def test_poisson_interval_is_exact(count, hours):
    rate = poisson_rate(count, hours)
    assert stats.poisson.cdf(count, rate["high"] * hours) == pytest.approx(0.025, rel=1e-6)
    if count:
        assert stats.poisson.sf(count - 1, rate["low"] * hours) == pytest.approx(0.025, rel=1e-6)
    else:
        assert rate["low"] == 0
        assert rate["high"] * hours == pytest.approx(-np.log(0.025))


@pytest.mark.parametrize(
    ("peak", "name"), [(0.0, "0-4"), (4.0, "4-8"), (15.99, "8-16"), (64.0, "64-128"), (200, "128-")]
)
def test_strata_are_half_open(peak, name):
    assert stratum(peak) == name


def hit(onset, peak):
    return Collision("pulse", onset, onset + 0.05, 2, np.zeros(3), np.zeros(3), peak)


def test_figures_of_a_small_trace():
    collisions = [hit(10, 5.0), hit(20, 20.0), hit(30, 40.0), hit(40, 20.0)]
    alarms = [Alarm(20.01, 20.1), Alarm(30.03, 30.2), Alarm(50.0, 50.1)]
    out = detection_metrics([match(alarms, collisions, (0.0, 60.0))])
    # 10, 8.95 (3 times) and 18.95 s free: 5 + 3 x 4 + 9 cases of 2 s
    assert out["confusion"] == {"tp": 2, "fn": 2, "fp": 1, "tn": 25}
    assert out["sensitivity"]["value"] == 0.5
    assert out["specificity"]["value"] == pytest.approx(25 / 26)
    assert out["ppv"]["value"] == pytest.approx(2 / 3)
    assert out["accuracy"]["value"] == pytest.approx(27 / 30)
    assert out["delay_ms"]["median"] == pytest.approx(20.0)
    assert out["false_alarms_per_hour"]["value"] == pytest.approx(3600 / 55.8)
    assert list(out["strata"]) == ["4-8", "8-16", "16-32", "32-64", "64-128"]
    assert out["strata"]["16-32"]["sensitivity"]["n"] == 2
    assert out["strata"]["8-16"]["sensitivity"]["value"] is None
    assert out["headline"]["sensitivity"]["value"] == pytest.approx(2 / 3)


def test_figures_of_several_traces_are_pooled():
    one = match([], [hit(10, 20.0)], (0.0, 60.0))
    two = match([Alarm(10.0, 11.0)], [hit(10, 200.0)], (0.0, 60.0))
    out = detection_metrics([one, two])
    assert out["sensitivity"]["value"] == 0.5
    assert out["strata"]["128-"]["sensitivity"]["value"] == 1.0
    assert out["false_alarms_per_hour"]["hours"] == pytest.approx((120 - 2 * 1.05) / 3600)
