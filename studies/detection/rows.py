"""Rows of the dissertation's experiment, and their tables and figure."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from studies.detection.operating import AMPERES, HOURLY, Fleet, Outcome, Tallies, Tally
from studies.framework import groups, table_rows
from tauguard.detectors.evaluation.matching import HEADLINE, delay_metrics
from tauguard.report import Row, poisson_rate, rate
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
#: The dissertation's method with which each detector is compared: its SVR (0) or network (1).
BESIDE = {"srq-svr": 0, "srq-svr-plain": 0, "current-network": 1}
#: The lowest torque of the 65 tested collisions [N m].
LOWEST = 4.0
#: tau98 is the smallest torque above which this fraction of the collisions is found.
GOAL = 0.98

BySpeed = Mapping[float, Tallies]


def rows(by_speed: BySpeed, fleets: Sequence[Fleet]) -> list[Row]:
    """Rows ``speed``, ``hourly``, ``strata``, ``dissertation`` and ``headline``."""
    names, points = list(fleets[0]), [*map(str, AMPERES), HOURLY]
    found: list[Row] = []
    for name in names:
        for amperes in AMPERES:
            known = {"study": "speed", "detector": name, "threshold_a": amperes}
            known |= _thresholds(fleets, name, str(amperes))
            for speed, tallies in by_speed.items():
                found.append({**known, "speed": speed, **_figures(tallies[name, str(amperes)])})
    for name in names:
        whole = Tally()
        for tallies in by_speed.values():
            whole.add(tallies[name, HOURLY])
        known = {"study": "hourly", "detector": name, **_thresholds(fleets, name, HOURLY)}
        for speed, tally in [*((s, t[name, HOURLY]) for s, t in by_speed.items()), (0.0, whole)]:
            found.append({**known, "speed": speed, **_figures(tally)})
    for name in names:
        for point in points:
            for speed, tallies in by_speed.items():
                found += _strata(name, point, speed, tallies[name, point].outcomes)
    found += _dissertation(by_speed, names)
    return found + headline(found)


def _thresholds(fleets: Sequence[Fleet], name: str, point: str) -> Row:
    """Thresholds of the normalised score (network: amperes): median and range over arms."""
    values = [fleet[name].thresholds[point] for fleet in fleets]
    low, high = float(min(values)), float(max(values))
    return {"threshold": float(np.median(values)), "threshold_low": low, "threshold_high": high}


def countable(tally: Tally) -> list[Outcome]:
    """The outcomes of collisions from ``LOWEST`` up, without the faint ones."""
    return [outcome for outcome in tally.outcomes if outcome.collision.peak_tau >= LOWEST]


def sensitivity(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """The fraction of collisions found, with a Wilson interval."""
    return rate(sum(outcome.delay is not None for outcome in outcomes), len(outcomes))


def tau98(outcomes: Sequence[Outcome]) -> float | None:
    """The smallest torque above which sensitivity is 0.98 [N m]; ``None`` where it never is."""
    ordered = sorted(outcomes, key=lambda outcome: -outcome.collision.peak_tau)
    missed = np.cumsum([outcome.delay is None for outcome in ordered])
    good = np.flatnonzero(missed <= (1 - GOAL) * np.arange(1, len(ordered) + 1) + 1e-9)
    return ordered[good[-1]].collision.peak_tau if len(good) else None


def _figures(tally: Tally) -> Row:
    """Counts and rates of the collisions from ``LOWEST`` up, then those from 16 N m up."""
    own = countable(tally)
    hits = sum(outcome.delay is not None for outcome in own)
    true_cases = tally.cases - tally.false_cases
    return {
        "tp": hits,
        "fn": len(own) - hits,
        "fp": tally.false_cases,
        "tn": true_cases,
        "specificity": rate(true_cases, tally.cases),
        "tau98": tau98(tally.outcomes),
        "hours": tally.free_seconds / 3600,
        **summary(tally),
    }


def summary(tally: Tally) -> Row:
    """Sensitivity and delay from 16 N m up, and false alarms per hour."""
    hard = [outcome for outcome in tally.outcomes if outcome.collision.peak_tau >= HEADLINE]
    return {
        "sensitivity": sensitivity(hard),
        "sensitivity_all": sensitivity(countable(tally)),
        "delay_ms": delay_metrics(outcome.delay for outcome in hard),
        "false_alarms_per_hour": poisson_rate(tally.false_alarms, tally.free_seconds / 3600),
    }


def _low(name: str) -> float:
    return float(name.split("-")[0])


def _strata(name: str, point: str, speed: float, outcomes: Sequence[Outcome]) -> list[Row]:
    by_torque = groups(outcomes, lambda outcome: stratum(outcome.collision.peak_tau))
    known = {"study": "strata", "detector": name, "point": point, "speed": speed}
    return [
        {**known, "torque_nm": kind, "sensitivity": sensitivity(by_torque[kind])}
        for kind in sorted(by_torque, key=_low)
    ]


def _dissertation(by_speed: BySpeed, names: Sequence[str]) -> list[Row]:
    """The dissertation's confusion matrices beside ours, all 65 collisions of each cell."""
    found: list[Row] = []
    for k, amperes in enumerate(AMPERES):
        for name in (name for name in BESIDE if name in names):
            for speed, tallies in by_speed.items():
                tp, fn, fp, tn = DISSERTATION[speed][2 * k + BESIDE[name]]
                ours = _figures(tallies[name, str(amperes)])
                found.append(
                    {
                        "study": "dissertation",
                        "detector": name,
                        "speed": speed,
                        "threshold_a": amperes,
                        "theirs": f"{tp},{fn},{fp},{tn}",
                        "ours": ",".join(str(ours[key]) for key in ("tp", "fn", "fp", "tn")),
                        "their_sensitivity": rate(tp, tp + fn),
                        "sensitivity": ours["sensitivity_all"],
                        "their_specificity": rate(tn, tn + fp),
                        "specificity": ours["specificity"],
                    }
                )
    return found


def headline(found: Sequence[Row]) -> list[Row]:
    """A row per operating point and speed, from 16 N m up.

    The best detector, the same in all cells, has the largest minimum of its rates over the cells
    (if equal, the largest sum). ``met`` says whether both of its rates reach 0.98 and both of
    SVR-SRQ's reach those of the dissertation's SVR in that cell.
    """
    by_name = groups(table_rows(found, "speed"), lambda row: str(row["detector"]))

    def quality(name: str) -> tuple[float, float]:
        rates = [value for row in by_name[name] for value in _values(row)]
        return min(rates), sum(rates)

    best = max(by_name, key=quality)
    theirs = {
        (r["threshold_a"], r["speed"]): (r["their_sensitivity"], r["their_specificity"])
        for r in table_rows(found, "dissertation")
        if r["detector"] == "srq-svr"
    }
    made = []
    for number, row in enumerate(by_name[best]):
        rates = {"best_rates": _values(row)}
        for name in (name for name in ("srq-svr", "srq-svr-plain") if name in by_name):
            rates[name] = _values(by_name[name][number])
        reached = min(rates["best_rates"]) >= GOAL
        cell = theirs.get((row["threshold_a"], row["speed"]))
        if cell:
            its = rates["dissertation"] = (cell[0]["value"], cell[1]["value"])
            ours = rates["srq-svr"]
            reached &= ours[0] >= its[0] and ours[1] >= its[1]
        known = {"study": "headline", "threshold_a": row["threshold_a"], "speed": row["speed"]}
        shown = {name: "{:.3f} / {:.3f}".format(*pair) for name, pair in rates.items()}
        made.append({**known, "best": best, **shown, "met": bool(reached)})
    return made


def _values(row: Row) -> tuple[float, float]:
    """Sensitivity and specificity of a cell; 0 without test cases."""
    return row["sensitivity"]["value"] or 0.0, row["specificity"]["value"] or 0.0


def printed(found: Sequence[Row]) -> list[Row]:
    """The tables to print: speeds are columns, and the headline comes last."""
    compact = {"speed": _cells, "hourly": _hourly, "strata": _torques}
    same, shown = ("detector", "threshold_a", "point"), list[Row]()
    for name, make in compact.items():
        lines = groups(table_rows(found, name), lambda r: str([r.get(key) for key in same]))
        shown += [make(own) for own in lines.values()]
    rest = [row for row in found if row["study"] not in (*compact, "headline")]
    return shown + rest + table_rows(found, "headline")


def _threshold(row: Row) -> str:
    low, high, middle = row["threshold_low"], row["threshold_high"], f"{row['threshold']:.3g}"
    return middle if low == high else f"{middle} [{low:.3g}, {high:.3g}]"


def _cells(own: list[Row]) -> Row:
    known = {key: own[0][key] for key in ("study", "detector", "threshold_a")}
    speeds = {f"{r['speed']:g} %": "{:.3f} / {:.3f}".format(*_values(r)) for r in own}
    return {**known, "threshold": _threshold(own[0]), "sensitivity / specificity": "", **speeds}


def _hourly(own: list[Row]) -> Row:
    """The printed row of one detector: all speeds together, then tau98 by speed."""
    whole = next(row for row in own if row["speed"] == 0)
    return {
        "study": "hourly",
        "detector": whole["detector"],
        "threshold": _threshold(whole),
        "sensitivity": whole["sensitivity"],
        "from 4 N m": whole["sensitivity_all"],
        "median_ms": whole["delay_ms"]["median"],
        "p95_ms": whole["delay_ms"]["p95"],
        "alarms_per_hour": whole["false_alarms_per_hour"],
        "hours": whole["hours"],
        "tau98": "",
        **{f"{row['speed']:g} %": row["tau98"] for row in own if row["speed"]},
    }


def _torques(own: list[Row]) -> Row:
    """Fraction of collisions found, by torque, over all speeds."""
    by_torque = groups(own, lambda row: str(row["torque_nm"]))
    kinds = {kind: _together(by_torque[kind]) for kind in sorted(by_torque, key=_low)}
    return {"study": "strata", "detector": own[0]["detector"], "point": own[0]["point"], **kinds}


def _together(own: Sequence[Row]) -> str:
    """The sum of some rates, as ``found/all``."""
    rates = [row["sensitivity"] for row in own]
    hits = sum(round((one["value"] or 0.0) * one["n"]) for one in rates)
    return f"{hits}/{sum(one['n'] for one in rates)}"


def draw(found: list[Row], figure: Any) -> None:
    """Panels: sensitivity over torque; tau98 and delay over speed; cells of all methods."""
    (torque, least), (delay, cells) = figure.subplots(2, 2)
    hourly = groups(table_rows(found, "hourly"), lambda row: str(row["detector"]))
    strata = [row for row in table_rows(found, "strata") if row["point"] == HOURLY]
    kinds = sorted({row["torque_nm"] for row in strata}, key=_low)
    for k, (name, own) in enumerate(hourly.items()):
        mine = groups([r for r in strata if r["detector"] == name], lambda r: str(r["torque_nm"]))
        pairs = [_together(mine[kind]).split("/") for kind in kinds if kind in mine]
        torque.plot(range(len(pairs)), [int(a) / int(b) for a, b in pairs], "o-", label=name, ms=3)
        own = [row for row in own if row["speed"]]
        speed, style = [row["speed"] for row in own], {"color": f"C{k}", "ms": 3}
        least.plot(speed, [row["tau98"] or np.nan for row in own], "o-", **style)
        for key, line in (("median", "o-"), ("p95", ":")):
            delay.plot(speed, [row["delay_ms"][key] or np.nan for row in own], line, **style)
    for name, own in groups(table_rows(found, "dissertation"), lambda r: r["detector"]).items():
        x = [1 - row["specificity"]["value"] for row in own]
        cells.plot(x, [row["sensitivity"]["value"] for row in own], "o", ms=5, label=name)
        if name == "srq-svr":
            x = [1 - row["their_specificity"]["value"] for row in own]
            y = [row["their_sensitivity"]["value"] for row in own]
            cells.plot(x, y, "kx", label="dissertation, SVR")
    torque.set_xticks(range(len(kinds)), kinds, rotation=30)
    torque.set(xlabel="achieved peak |tau_ext| over joints 1-4 [N m]", ylabel="sensitivity")
    least.set(yscale="log", ylabel="torque above which 98 % are found [N m]")
    delay.set(yscale="log", ylabel="delay [ms]: median, 95th percentile dotted")
    for axis in (least, delay):
        axis.set(xlabel="speed [% of the maximum]")
    cells.set(xlabel="1 - specificity (motion cases)", ylabel="sensitivity, all collisions")
    for axis in (torque, least, delay, cells):
        axis.grid(alpha=0.3)
    torque.legend(fontsize=7, framealpha=0.5)
    cells.legend(fontsize=7)
