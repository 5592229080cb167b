"""Metrics of a detector over many traces, each with its 95 % interval."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from tauguard.detectors.evaluation.matching import Matching
from tauguard.report import poisson_rate
from tauguard.report import rate as wilson
from tauguard.traces.severity import STRATA, stratum

#: Least peak torque of the collisions in ``headline`` [N m].
HEADLINE = 16.0


def delay_metrics(delays: Iterable[float | None]) -> dict[str, Any]:
    """Median and 95th percentile of the detected collisions' delays [ms]."""
    known = np.array([d for d in delays if d is not None]) * 1e3
    if not len(known):
        return {"median": None, "p95": None, "n": 0}
    median, p95 = np.percentile(known, (50, 95))
    return {"median": float(median), "p95": float(p95), "n": len(known)}


def _severity(pairs: Sequence[tuple[float, float | None]]) -> dict[str, Any]:
    found = [delay is not None for _, delay in pairs]
    return {
        "sensitivity": wilson(sum(found), len(found)),
        "delay_ms": delay_metrics(delay for _, delay in pairs),
    }


def detection_metrics(matchings: Iterable[Matching]) -> dict[str, Any]:
    """All metrics over the given traces.

    Returns:
        ``confusion`` (tp, fn over collisions; fp, tn over non-collision cases), ``sensitivity``,
        ``specificity``, ``ppv``, ``accuracy`` (each value, low, high, n), ``delay_ms`` (median,
        p95, n), ``false_alarms_per_hour`` (of collision-free time), ``strata`` (by peak torque,
        each with sensitivity and delay) and ``headline`` (sensitivity and delay from 16 N m up).
    """
    several = list(matchings)
    pairs = [
        (collision.peak_tau, delay)
        for m in several
        for collision, delay in zip(m.collisions, m.delays, strict=True)
    ]
    tp = sum(delay is not None for _, delay in pairs)
    fn = len(pairs) - tp
    fp = sum(m.false_cases for m in several)
    tn = sum(m.cases for m in several) - fp
    alarms = sum(len(m.false_alarms) for m in several)
    hours = sum(m.free_seconds for m in several) / 3600
    names = [stratum(peak) for peak, _ in pairs]
    every = set(names) | {stratum(low) for low, _ in STRATA}
    order = sorted(every, key=lambda name: float(name.split("-")[0]))
    return {
        "confusion": {"tp": tp, "fn": fn, "fp": fp, "tn": tn},
        "sensitivity": wilson(tp, tp + fn),
        "specificity": wilson(tn, tn + fp),
        "ppv": wilson(tp, tp + fp),
        "accuracy": wilson(tp + tn, tp + fn + fp + tn),
        "delay_ms": delay_metrics(delay for _, delay in pairs),
        "false_alarms_per_hour": poisson_rate(alarms, hours),
        "strata": {
            name: _severity([p for p, own in zip(pairs, names, strict=True) if own == name])
            for name in order
        },
        "headline": _severity([p for p in pairs if p[0] >= HEADLINE]),
    }
