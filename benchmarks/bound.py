"""The report: every study of a folder in one HTML file that opens offline."""

from __future__ import annotations

import importlib
import json
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from tauguard.benchmarks import STUDIES
from tauguard.benchmarks.panels import panels
from tauguard.report import Row, machine, versions
from tauguard.report.page import folded, page, picture, tables
from tauguard.report.pareto import svg
from tauguard.whole_file import write_whole


def bind(folder: Path, cases: Sequence[Row], failed: Mapping[str, str]) -> Path:
    """Write ``index.html`` of the studies' files in ``folder`` and the rows of the hard cases.

    Args:
        folder: what :func:`tauguard.benchmarks.collect.collect` has written.
        cases: rows of :func:`tauguard.hard_cases.run`.
        failed: why, for each study that has no file.
    """
    found = {
        name: json.loads(path.read_text())
        for name in STUDIES
        if (path := folder / f"{name}.json").exists() and name not in failed
    }
    sections = {
        "What was measured": _measured(found, failed),
        "Error against microseconds": _pareto(found),
        "What each modelled thing costs": _costs(found),
        "Hard cases": _cases(cases),
        **{f"Study: {name}": _study(folder, name, one) for name, one in found.items()},
    }
    target = folder / "index.html"
    write_whole(target, page("tauguard: speed against error", sections))
    return target


def _measured(found: Mapping[str, Any], failed: Mapping[str, str]) -> str:
    info = {**machine(), **versions()}
    runs = [
        {
            "study": None,
            "bench": name,
            "question": STUDIES[name].line,
            "run": "quick" if one["quick"] else "full",
            "seed": one["seed"],
            "rows": len(one["rows"]),
        }
        for name, one in found.items()
    ]
    lost = "".join(f"<li>{escape(n)}: {escape(why)}</li>" for n, why in failed.items())
    return (
        "<p>Every figure of speed stands beside its error, and beside a peer of the same run where "
        "there is one. A quick run shows the form of the answers, a full run their size. "
        "Times were taken on this machine:</p>"
        + tables([{"what": key, "value": value} for key, value in info.items()], {})
        + tables(runs, {})
        + (f"<p>Not in this report:</p><ul>{lost}</ul>" if lost else "")
    )


def _pareto(found: Mapping[str, Any]) -> str:
    drawn = [panel for name, one in found.items() for panel in panels(name, one["rows"])]
    pictures = "".join(picture(svg(p).encode(), "svg+xml", p.title) for p in drawn)
    return (
        "<p>Left is fast, low is right. The grey line joins what nothing else beats in both. "
        "Circles are tauguard's, squares are peers of the same run.</p>"
        f'<div class="figures">{pictures}</div>'
    )


def _costs(found: Mapping[str, Any]) -> str:
    rows = [row for row in found.get("simulation", {"rows": []})["rows"] if row["study"] == "cost"]
    if not rows:
        return "<p>The study simulation is not in this report.</p>"
    return tables(rows, _notes("simulation"))


def _cases(rows: Sequence[Row]) -> str:
    from tauguard.hard_cases.verdicts import verdicts

    shown = ("case", "library", "expected", "answer", "right", "why")
    full = tables([{key: row[key] for key in shown} for row in rows], {})
    return (
        "<p>Named cases with exact answers, put to every library that is installed; "
        "<code>tauguard hard-cases</code> runs them, on other libraries too.</p>"
        + tables(verdicts(rows), {})
        + folded(f"All {len(rows)} answers", full)
    )


def _notes(name: str) -> Mapping[str, str]:
    notes: Mapping[str, str] = getattr(_module(name), "NOTES", {})
    return notes


def _module(name: str) -> Any:
    return importlib.import_module(f"tauguard.benchmarks.{STUDIES[name].module}")


def _study(folder: Path, name: str, found: Mapping[str, Any]) -> str:
    shown = getattr(_module(name), "shown", None)
    rows = shown(found["rows"]) if shown else found["rows"]
    chart = folder / f"{name}.png"
    figure = picture(chart.read_bytes(), "png", f"chart of {name}") if chart.exists() else ""
    return f"<p>{escape(STUDIES[name].line)}</p><figure>{figure}</figure>" + folded(
        "Tables", tables(rows, _notes(name))
    )
