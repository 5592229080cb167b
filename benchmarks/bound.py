"""The report: every study of a folder in one HTML file that opens offline."""

from __future__ import annotations

import importlib
import json
from collections.abc import Callable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from tauguard.benchmarks import STUDIES
from tauguard.benchmarks.glance import detection, kernels
from tauguard.benchmarks.panels import panels, rows_of
from tauguard.benchmarks.run import chart
from tauguard.report import Row
from tauguard.report.page import folded, page, picture, tables
from tauguard.report.pareto import svg
from tauguard.whole_file import write_whole

#: A file of a study, read.
Found = Mapping[str, Any]


def bind(folder: Path, cases: Sequence[Row], failed: Mapping[str, str], mistakes: str = "") -> Path:
    """Write ``index.html`` of the studies' files in ``folder`` and the rows of the hard cases.

    Args:
        folder: what :func:`tauguard.benchmarks.collect.collect` has written.
        cases: rows of :func:`tauguard.hard_cases.run`.
        failed: why, for each study that has no file.
        mistakes: HTML that links to recordings of what a detector got wrong.
    """
    found = {
        name: json.loads(path.read_text())
        for name in STUDIES
        if (path := folder / f"{name}.json").exists() and name not in failed
    }
    rows = {name: one["rows"] for name, one in found.items()}
    sections = {
        "How fast, how wrong, beside whom": _first(rows),
        "Collisions found, false alarms": _found(rows),
        "Error against microseconds": _pareto(rows),
        "Asked and not reached": _missed(rows),
        "What each modelled thing costs": _costs(rows),
        "Hard cases": _cases(cases),
        "Mistakes to look at": mistakes,
        "What was measured": _measured(found, failed),
        **{f"Study: {name}": _study(name, one) for name, one in found.items()},
    }
    target = folder / "index.html"
    text = page("tauguard: speed against error", sections, _where(found))
    write_whole(target, text)
    return target


def _where(found: Mapping[str, Found]) -> str:
    """The machine and the versions in one paragraph each; more than one where files differ."""
    machines: dict[str, list[str]] = {}
    for name, one in found.items():
        on = one["machine"]
        text = f"{on['processor']}, {on['cores']} cores, {on['system']}: " + ", ".join(
            f"{package} {version}" for package, version in one["versions"].items()
        )
        machines.setdefault(text, []).append(name)
    kinds = {"quick" if one["quick"] else "full" for one in found.values()}
    runs = f"{len(found)} of {len(STUDIES)} studies, {' and '.join(sorted(kinds))} runs. "
    many = len(machines) > 1
    lines = [
        f"<p>{escape(text + (' (' + ', '.join(names) + ')' if many else ''))}.</p>"
        for text, names in machines.items()
    ]
    return f"<p>{escape(runs)}Every time stands beside its error.</p>" + "".join(lines)


def _first(rows: Mapping[str, Sequence[Row]]) -> str:
    return (
        "<p>Time and error of each kernel and of a peer in the same run, one thread. "
        "A ratio above 1 says that tauguard is faster.</p>"
        + (tables(kernels(rows), {}) or "<p>None of these studies is in this report.</p>")
    )


def _found(rows: Mapping[str, Sequence[Row]]) -> str:
    return (
        "<p>Collisions of arms that no threshold was set on, each figure with its 95 % interval. "
        "Simulated: thresholds for one false alarm an hour. Real: pushes on a UR5.</p>"
        + (tables(detection(rows), {}) or "<p>None of these studies is in this report.</p>")
    )


def _pareto(rows: Mapping[str, Sequence[Row]]) -> str:
    drawn = panels(rows)
    pictures = "".join(picture(svg(p).encode(), "svg+xml", p.title) for p in drawn)
    return (
        "<p>Left is fast, low is right. The grey line joins what nothing else beats in both. "
        "Circles are tauguard's, squares are peers of the same run.</p>"
        f'<div class="figures">{pictures}</div>'
    )


def _missed(rows: Mapping[str, Sequence[Row]]) -> str:
    """Every bar of a study's closing summary that its run did not reach."""
    bars = [(name, row) for name, own in rows.items() for row in own if "asked" in row]
    judged = [(name, row) for name, row in bars if isinstance(row.get("met"), bool)]
    lost = [
        {
            "bench": name,
            "what": row.get("question") or row.get("claim") or row.get("what"),
            "asked": row["asked"],
            "measured": row["measured"],
        }
        for name, row in judged
        if not row["met"]
    ]
    return f"<p>{len(judged) - len(lost)} of {len(judged)} bars are met.</p>" + tables(lost, {})


def _costs(rows: Mapping[str, Sequence[Row]]) -> str:
    parts = [
        tables(own, _notes(name)) if own else f"<p>The study {name} is not in this report.</p>"
        for name, study in (("simulation", "cost"), ("needs", "needs"))
        for own in [rows_of(rows, name, study)]
    ]
    return "\n".join(parts)


def _cases(rows: Sequence[Row]) -> str:
    from tauguard.hard_cases.verdicts import by_library

    shown = ("case", "library", "expected", "answer", "right", "why", "origin")
    full = [{key: row[key] for key in shown} for row in rows]
    wrong = [row for row in rows if not row["right"] and row["library"] == "tauguard"]
    columns = ("case", "expected", "answer", "why", "explained")
    ours = [{key: row[key] for key in columns} for row in wrong]
    return (
        "<p>Named cases with exact answers, put to every library that is installed; "
        "<code>tauguard hard-cases</code> runs them, on other libraries too. "
        "Right answers of those asked:</p>"
        + tables(by_library(rows), {})
        + (f"<p>What tauguard answers wrongly:</p>{tables(ours, {})}" if ours else "")
        + folded(f"All {len(rows)} answers", tables(full, {}))
    )


def _measured(found: Mapping[str, Found], failed: Mapping[str, str]) -> str:
    runs = [
        {
            "bench": name,
            "question": STUDIES[name].line,
            "run": "quick" if one["quick"] else "full",
            "seed": one["seed"],
            "rows": len(one["rows"]),
        }
        for name, one in found.items()
    ]
    absent = [n + (f" ({failed[n]})" if n in failed else "") for n in STUDIES if n not in found]
    lost = ", ".join(absent)
    return (
        "<p>A quick run shows the form of the answers, a full run their size.</p>"
        + tables(runs, {})
        + (f"<p>Not in this report: {escape(lost)}.</p>" if lost else "")
    )


def _notes(name: str) -> Mapping[str, str]:
    notes: Mapping[str, str] = getattr(_module(name), "NOTES", {})
    return notes


def _module(name: str) -> Any:
    return importlib.import_module(f"tauguard.benchmarks.{STUDIES[name].module}")


def _study(name: str, found: Found) -> str:
    shown: Callable[[list[Row]], list[Row]] | None = getattr(_module(name), "shown", None)
    rows = shown(found["rows"]) if shown else found["rows"]
    try:
        figure = picture(chart(_module(name), found["rows"]), "png", f"chart of {name}")
    except (AttributeError, IndexError, KeyError, StopIteration, TypeError, ValueError) as error:
        # Figures of another build, or of a part of the study: the tables are there all the same.
        figure = f"<p>These rows have no chart ({escape(repr(error))}).</p>"
    run = f"{'quick' if found['quick'] else 'full'} run, seed {found['seed']}"
    stopped = f"; incomplete: {found['incomplete']}" if "incomplete" in found else ""
    return (
        f"<p>{escape(STUDIES[name].line)} ({escape(run + stopped)}).</p>"
        f"<figure>{figure}</figure>" + folded("Tables", tables(rows, _notes(name)))
    )
