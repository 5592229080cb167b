"""Rows of the detection study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy import stats

from studies.detection.judge import Outcome, Tallies, Tally
from studies.detection.oracle import LEVELS, ORACLE, at_level
from studies.detection.thresholds import AMPERES, HOURLY, ONCE, POINTS, Fleet
from tauguard.detectors.evaluation.metrics import HEADLINE, poisson_rate
from tauguard.report import Row
from tauguard.report import rate as wilson
from tauguard.traces import stratum

#: The dissertation's confusion matrices (TP, FN, FP, TN; 65 collisions) by speed [%]:
#: SVR at 1.6 A, network of [25] at 1.6 A, SVR at 2.0 A, network at 2.0 A. Kowalczuk & Czubenko.
DISSERTATION = {
    10.0: ((60, 5, 29, 113), (59, 6, 29, 113), (51, 14, 3, 113), (52, 13, 3, 113)),
    20.0: ((59, 6, 40, 135), (60, 5, 39, 136), (50, 15, 4, 135), (49, 16, 3, 136)),
    30.0: ((57, 8, 76, 136), (56, 9, 75, 137), (53, 12, 10, 136), (52, 13, 9, 137)),
    40.0: ((60, 5, 65, 158), (62, 3, 64, 159), (56, 9, 10, 158), (57, 8, 10, 158)),
    50.0: ((59, 6, 90, 180), (59, 6, 89, 181), (56, 9, 16, 178), (58, 7, 15, 181)),
    60.0: ((59, 6, 87, 167), (59, 6, 87, 167), (59, 6, 12, 166), (59, 6, 12, 166)),
}
#: The lowest torque of the 65 judged collisions [N m].
LOWEST = 4.0
#: tau98 is the smallest torque above which this share of the collisions is found.
TAU_SHARE = 0.98

BySpeed = Mapping[float, Tallies]
#: Every arm's threshold of a detector at a point.
Spread = Mapping[str, Mapping[str, Sequence[float]]]


def spread(fleets: Sequence[Fleet]) -> Spread:
    """The thresholds by detector and point, arm by arm."""
    return {
        name: {p: [fleet[name].thresholds[p] for fleet in fleets] for p in own.thresholds}
        for name, own in fleets[0].items()
    }


def _threshold(values: Sequence[float]) -> Row:
    """Of the normalised score (the network's first two: amperes): median over arms and range."""
    low, high = float(min(values)), float(max(values))
    return {"threshold": float(np.median(values)), "threshold_low": low, "threshold_high": high}


def rows(by_speed: BySpeed, thresholds: Spread) -> list[Row]:
    """All rows: speed, hourly, once, floor, strata, dissertation, mcnemar, output."""
    names = list(thresholds)
    return [
        *cells(by_speed, thresholds, names),
        *hourly(by_speed, thresholds, names),
        *hourly(by_speed, thresholds, names, "once", ONCE),
        *floor(by_speed),
        *strata(by_speed, names),
        *dissertation(by_speed, names),
        *mcnemar(by_speed, names),
        *outputs(by_speed, names),
    ]


def countable(tally: Tally) -> list[Outcome]:
    """The outcomes of the 65, without the faint ones."""
    return [o for o in tally.outcomes if o.collision.peak_tau >= LOWEST]


def found(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Sensitivity with its Wilson interval."""
    return wilson(sum(o.delay is not None for o in outcomes), len(outcomes))


def delays(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Median (95 % interval from order statistics), 95th percentile [ms]."""
    known = np.sort([1e3 * o.delay for o in outcomes if o.delay is not None])
    n = len(known)
    if not n:
        return {"median": None, "low": None, "high": None, "p95": None, "n": 0}
    low, high = stats.binom.ppf((0.025, 0.975), n, 0.5)
    return {
        "median": float(np.median(known)),
        "low": float(known[max(int(low) - 1, 0)]),
        "high": float(known[min(int(high), n - 1)]),
        "p95": float(np.percentile(known, 95)),
        "n": n,
    }


def tau98(outcomes: Sequence[Outcome]) -> float | None:
    """The smallest torque above which sensitivity is 0.98 [N m]; ``None`` where it never is."""
    ordered = sorted(outcomes, key=lambda o: -o.collision.peak_tau)
    missed = np.cumsum([o.delay is None for o in ordered])
    good = np.flatnonzero(missed <= (1 - TAU_SHARE) * np.arange(1, len(ordered) + 1) + 1e-9)
    return ordered[good[-1]].collision.peak_tau if len(good) else None


def _figures(tally: Tally) -> Row:
    """The common part of a row: the headline strata, then all 65."""
    own = countable(tally)
    hard = [o for o in own if o.collision.peak_tau >= HEADLINE]
    hits = sum(o.delay is not None for o in hard)
    return {
        "tp": hits,
        "fn": len(hard) - hits,
        "fp": tally.false_cases,
        "tn": tally.cases - tally.false_cases,
        "sensitivity": found(hard),
        "specificity": wilson(tally.cases - tally.false_cases, tally.cases),
        "delay_ms": delays(hard),
        "false_alarms_per_hour": poisson_rate(tally.false_alarms, tally.free_seconds / 3600),
        "tp_all": sum(o.delay is not None for o in own),
        "fn_all": sum(o.delay is None for o in own),
        "sensitivity_all": found(own),
        "tau98": tau98(tally.outcomes),
    }


def headline(tally: Tally) -> Row:
    """Sensitivity and delay from 16 N m up, and false alarms per hour."""
    own = [o for o in tally.outcomes if o.collision.peak_tau >= HEADLINE]
    return {
        "sensitivity": found(own),
        "sensitivity_all": found(countable(tally)),
        "delay_ms": delays(own),
        "false_alarms_per_hour": poisson_rate(tally.false_alarms, tally.free_seconds / 3600),
    }


def cells(by_speed: BySpeed, thresholds: Spread, names: Sequence[str]) -> list[Row]:
    """``speed``: a row per detector, speed and ampere point."""
    return [
        {
            "study": "speed",
            "detector": name,
            "speed": speed,
            "threshold_a": amperes,
            **_threshold(thresholds[name][str(amperes)]),
            **_figures(tallies[name, str(amperes)]),
        }
        for name in names
        for speed, tallies in by_speed.items()
        for amperes in AMPERES
    ]


def hourly(
    by_speed: BySpeed,
    thresholds: Spread,
    names: Sequence[str],
    study: str = "hourly",
    point: str = HOURLY,
) -> list[Row]:
    """``hourly``: the same at the rate of false alarms aimed at; speed 0 is all speeds together."""
    found_rows: list[Row] = []
    for name in names:
        whole = Tally()
        for tallies in by_speed.values():
            whole.add(tallies[name, point])
        each = [(s, t[name, point]) for s, t in by_speed.items()]
        found_rows += [
            {
                "study": study,
                "detector": name,
                "speed": speed,
                **_threshold(thresholds[name][point]),
                **_figures(tally),
                "hours": tally.free_seconds / 3600,
            }
            for speed, tally in [*each, (0.0, whole)]
        ]
    return found_rows


def floor(by_speed: BySpeed) -> list[Row]:
    """``floor``: what an oracle of the true torque finds and when; all speeds are together."""
    found_rows: list[Row] = []
    for level in LEVELS:
        whole = Tally()
        for tallies in by_speed.values():
            whole.add(tallies.get((ORACLE, at_level(level)), Tally()))
        if whole.outcomes:
            hard = [o for o in whole.outcomes if o.collision.peak_tau >= HEADLINE]
            found_rows.append(
                {
                    "study": "floor",
                    "detector": f"oracle, true torque above {at_level(level)}",
                    "sensitivity": found(hard),
                    "median_ms": delays(hard)["median"],
                    "p95_ms": delays(hard)["p95"],
                    "median_ms from 4 N m": delays(countable(whole))["median"],
                    "p95_ms from 4 N m": delays(countable(whole))["p95"],
                }
            )
    return found_rows


def strata(by_speed: BySpeed, names: Sequence[str]) -> list[Row]:
    """``strata``: sensitivity and delay by achieved peak torque, at every operating point."""
    found_rows: list[Row] = []
    for name in names:
        for point in POINTS:
            for speed, tallies in by_speed.items():
                outcomes = tallies[name, point].outcomes
                kinds = sorted(
                    {stratum(o.collision.peak_tau) for o in outcomes},
                    key=lambda s: float(s.split("-")[0]),
                )
                for kind in kinds:
                    own = [o for o in outcomes if stratum(o.collision.peak_tau) == kind]
                    found_rows.append(
                        {
                            "study": "strata",
                            "detector": name,
                            "point": point,
                            "speed": speed,
                            "torque_nm": kind,
                            "sensitivity": found(own),
                            "delay_ms": delays(own),
                        }
                    )
    return found_rows


def dissertation(by_speed: BySpeed, names: Sequence[str]) -> list[Row]:
    """``dissertation``: its confusion matrices beside ours, all 65 collisions of each cell."""
    found_rows: list[Row] = []
    for k, amperes in enumerate(AMPERES):
        for method, own in ((0, "srq-svr"), (0, "srq-svr-plain"), (1, "current-network")):
            if own not in names:
                continue
            for speed, tallies in by_speed.items():
                tp, fn, fp, tn = DISSERTATION[speed][2 * k + method]
                ours = _figures(tallies[own, str(amperes)])
                found_rows.append(
                    {
                        "study": "dissertation",
                        "detector": own,
                        "speed": speed,
                        "threshold_a": amperes,
                        "theirs": f"{tp},{fn},{fp},{tn}",
                        "ours": f"{ours['tp_all']},{ours['fn_all']},{ours['fp']},{ours['tn']}",
                        "their_sensitivity": wilson(tp, tp + fn),
                        "sensitivity": ours["sensitivity_all"],
                        "their_specificity": wilson(tn, tn + fp),
                        "specificity": ours["specificity"],
                    }
                )
    return found_rows


def mcnemar(by_speed: BySpeed, names: Sequence[str]) -> list[Row]:
    """``mcnemar``: exact tests on the same collisions, all speeds, every detector to the first."""
    found_rows: list[Row] = []
    for point in POINTS:
        for name in names[1:]:
            first = [o for t in by_speed.values() for o in countable(t[names[0], point])]
            other = [o for t in by_speed.values() for o in countable(t[name, point])]
            hits = [(a.delay is not None, b.delay is not None) for a, b in _paired(first, other)]
            only, missed = hits.count((True, False)), hits.count((False, True))
            n = only + missed
            found_rows.append(
                {
                    "study": "mcnemar",
                    "point": point,
                    "first": names[0],
                    "second": name,
                    "collisions": len(hits),
                    "only_first": only,
                    "only_second": missed,
                    "p": float(stats.binomtest(only, n).pvalue) if n else 1.0,
                }
            )
    return found_rows


def _paired(first: Sequence[Outcome], second: Sequence[Outcome]) -> list[tuple[Outcome, Outcome]]:
    """The same collisions, in the order in which they were judged."""
    pairs = list(zip(first, second, strict=True))
    assert all(a.collision.onset == b.collision.onset for a, b in pairs)
    return pairs


def outputs(by_speed: BySpeed, names: Sequence[str]) -> list[Row]:
    """``output``: how a detector's output grows with the torque, and each collision's pair.

    ``correlation`` is Spearman's between the achieved torque and the highest output.
    """
    found_rows: list[Row] = []
    for name in names:
        for speed, tallies in by_speed.items():
            own = tallies[name, HOURLY].outcomes
            torque, peak = [o.collision.peak_tau for o in own], [o.peak for o in own]
            steady = len(set(peak)) > 1
            found_rows.append(
                {
                    "study": "output",
                    "detector": name,
                    "speed": speed,
                    "correlation": float(stats.spearmanr(torque, peak)[0]) if steady else None,
                    "torque_nm": " ".join(f"{x:.3g}" for x in torque),
                    "output": " ".join(f"{x:.4g}" for x in peak),
                }
            )
    return found_rows
