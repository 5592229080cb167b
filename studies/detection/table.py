"""The detection study's printed form: compact tables, and the headline at the end.

The JSON keeps a row per detector, speed and operating point; on paper speeds are columns.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tauguard.report import Row

#: What the best detector has to reach from 16 N m up.
GOAL = 0.98
#: The one whose cells are held against the dissertation's.
OURS, PLAIN = "srq-svr", "srq-svr-plain"


def headline(rows: Sequence[Row]) -> list[Row]:
    """``headline``: a row per operating point and speed, from 16 N m up.

    The best detector is one for all cells: the one whose smallest rate over them is largest (then
    the largest sum). ``met`` says whether both of its rates reach 0.98 and both of SVR-SRQ's reach
    the dissertation's SVR in that cell.
    """
    cells = [r for r in rows if r["study"] == "speed"]
    theirs = {
        (r["threshold_a"], r["speed"]): r
        for r in rows
        if r["study"] == "dissertation" and r["detector"] == OURS
    }
    names = dict.fromkeys(r["detector"] for r in cells)
    name_of_best = max(names, key=lambda n: _quality([r for r in cells if r["detector"] == n]))
    found = []
    for point, speed in sorted({(r["threshold_a"], r["speed"]) for r in cells}):
        own = {r["detector"]: r for r in cells if (r["threshold_a"], r["speed"]) == (point, speed)}
        best = own[name_of_best]
        row: Row = {
            "study": "headline",
            "threshold_a": point,
            "speed": speed,
            "best": best["detector"],
            "best_sensitivity": best["sensitivity"],
            "best_specificity": best["specificity"],
        }
        reached = min(_values(best)) >= GOAL
        for name, key in ((OURS, "svr"), (PLAIN, "plain")):
            if name in own:
                row[f"{key}_sensitivity"], row[f"{key}_specificity"] = _values(own[name])
        if OURS in own and (point, speed) in theirs:
            cell = theirs[point, speed]
            theirs_sensitivity = cell["their_sensitivity"]["value"]
            theirs_specificity = cell["their_specificity"]["value"]
            row["dissertation_sensitivity"] = theirs_sensitivity
            row["dissertation_specificity"] = theirs_specificity
            sensitivity, specificity = _values(own[OURS])
            reached &= sensitivity >= theirs_sensitivity and specificity >= theirs_specificity
        found.append({**row, "met": bool(reached)})
    return found


def _values(row: Row) -> tuple[float, float]:
    """Sensitivity and specificity of a cell; 0 where nothing was judged."""
    return row["sensitivity"]["value"] or 0.0, row["specificity"]["value"] or 0.0


def _quality(rows: Sequence[Row]) -> tuple[float, float]:
    """The smallest rate of some cells, then their sum."""
    rates = [value for row in rows for value in _values(row)]
    return min(rates), sum(rates)


def shown(rows: Sequence[Row]) -> list[Row]:
    """What is printed, in the order of print; the headline comes last."""
    by_study: dict[str, list[Row]] = {}
    for row in rows:
        by_study.setdefault(row["study"], []).append(row)
    found = _cells(by_study.pop("speed", []))
    found += _hourly(by_study.pop("hourly", []))
    found += _hourly(by_study.pop("once", []))
    found += by_study.pop("floor", [])
    found += _strata(by_study.pop("strata", []))
    found += _outputs(by_study.pop("output", []))
    last = by_study.pop("headline", [])
    for own in by_study.values():
        found += own
    return found + last


def _groups(rows: Sequence[Row], *keys: str) -> list[tuple[tuple[Any, ...], list[Row]]]:
    """Rows with the same values of ``keys``, in order of first appearance."""
    found: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        found.setdefault(tuple(row[key] for key in keys), []).append(row)
    return list(found.items())


def _cells(rows: Sequence[Row]) -> list[Row]:
    """Sensitivity from 16 N m up and specificity, a row per detector and point."""
    return [
        {
            "study": "speed",
            "detector": name,
            "threshold_a": point,
            "threshold": _range(own[0]),
            "sensitivity / specificity": "",
            **{f"{r['speed']:g} %": "{:.3f} / {:.3f}".format(*_values(r)) for r in own},
        }
        for (name, point), own in _groups(rows, "detector", "threshold_a")
    ]


def _hourly(rows: Sequence[Row]) -> list[Row]:
    """The third point or the fourth: all speeds together, then tau98 by speed."""
    found = []
    for (name,), own in _groups(rows, "detector"):
        whole = next(r for r in own if r["speed"] == 0)
        each = [r for r in own if r["speed"]]
        found.append(
            {
                "study": whole["study"],
                "detector": name,
                "threshold": _range(whole),
                "sensitivity": whole["sensitivity"],
                "from 4 N m": whole["sensitivity_all"],
                "median_ms": whole["delay_ms"]["median"],
                "p95_ms": whole["delay_ms"]["p95"],
                "alarms_per_hour": whole["false_alarms_per_hour"],
                "hours": whole["hours"],
                "tau98": "",
                **{f"{r['speed']:g} %": r["tau98"] for r in each},
            }
        )
    return found


def _range(row: Row) -> str:
    """A threshold's median over arms and its range."""
    low, high = row["threshold_low"], row["threshold_high"]
    middle = f"{row['threshold']:.3g}"
    return middle if low == high else f"{middle} [{low:.3g}, {high:.3g}]"


def _strata(rows: Sequence[Row]) -> list[Row]:
    """Found of all by torque: every speed together, then (at the third point) speed by speed."""
    found = []
    for (name, point), own in _groups(rows, "detector", "point"):
        kinds = {kind: _together(part) for (kind,), part in _groups(own, "torque_nm")}
        kinds = dict(sorted(kinds.items(), key=lambda item: float(item[0].split("-")[0])))
        found.append({"study": "strata", "detector": name, "point": point, **kinds})
    last = [r for r in rows if r["point"] == "hourly"]
    for (name, speed), own in _groups(last, "detector", "speed"):
        kinds = {r["torque_nm"]: _together([r]) for r in own}
        found.append({"study": "strata", "detector": name, "speed": speed, **kinds})
    return found


def _together(rows: Sequence[Row]) -> str:
    """``found/all`` of some rates."""
    rates = [r["sensitivity"] for r in rows]
    hits = sum(round((rate["value"] or 0.0) * rate["n"]) for rate in rates)
    return f"{hits}/{sum(rate['n'] for rate in rates)}"


def _outputs(rows: Sequence[Row]) -> list[Row]:
    """Spearman's correlation of output and torque by speed; the figure shows the pairs."""
    return [
        {
            "study": "output",
            "detector": name,
            "correlation with torque": "",
            **{f"{r['speed']:g} %": r["correlation"] for r in own},
        }
        for (name,), own in _groups(rows, "detector")
    ]
