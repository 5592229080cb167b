"""The report: every study of a folder in one HTML file that opens offline."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from html import escape
from pathlib import Path
from typing import Any

from studies import STUDIES
from studies.gaps import Gaps
from studies.glance import detection, kernels
from studies.panels import panels, rows_of
from studies.run import chart
from studies.study_file import read_study
from tauguard.atomic_write import write_atomic
from tauguard.report import Row
from tauguard.report.page import folded, page, picture, tables
from tauguard.report.pareto import Panel, svg

#: A file of a study, read.
Found = Mapping[str, Any]
#: Other files of figures that the folder of a report holds.
BESIDE = ("hard-cases.json", "wrong.json")


def bind(
    folder: Path, cases: Sequence[Row], failed: Mapping[str, str], gaps: Gaps, mistakes: str = ""
) -> Path:
    """Write ``index.html`` of the studies' files in ``folder`` and the rows of the hard cases.

    Args:
        folder: what :func:`studies.collect.collect` has written, or anything else: a
            file that is damaged, of another program or of a part of a study is named in the page.
        cases: rows of :func:`tauguard.hard_cases.run`.
        failed: why, for each study that has no file.
        gaps: gets a line for each part that is not shown.
        mistakes: HTML that links to recordings of what a detector got wrong.
    """
    found = _read(folder, failed, gaps)
    rows = {name: one["rows"] for name, one in found.items()}
    studies = {f"Study: {name}": _study(name, one, gaps) for name, one in found.items()}
    sections = {
        "How fast, how wrong, beside whom": _first(rows, gaps),
        "Collisions found, false alarms": _found(rows, gaps),
        "Error against microseconds": _pareto(rows, gaps),
        "Asked and not reached": _missed(rows, gaps),
        "What each modelled thing costs": _costs(rows, gaps),
        "Hard cases": _cases(cases),
        "Mistakes to look at": mistakes,
        "What was measured": _measured(found, failed, _others(folder)),
        **studies,
    }
    target = folder / "index.html"
    write_atomic(target, page("tauguard: speed against error", sections, _where(found, gaps)))
    return target


def _read(folder: Path, failed: Mapping[str, str], gaps: Gaps) -> dict[str, Found]:
    """The studies whose files are theirs; the others, and parts that are missing, are gaps."""
    found: dict[str, Found] = {}
    for name in STUDIES:
        path = folder / f"{name}.json"
        if name in failed or not path.exists():
            continue
        try:
            found[name] = read_study(path, name)
        except (OSError, ValueError) as error:
            gaps.add(name, str(error))
            continue
        if not found[name]["rows"]:
            gaps.add(name, "its file has no rows")
        if "incomplete" in found[name]:
            gaps.add(name, f"incomplete: {found[name]['incomplete']}")
    return found


def _others(folder: Path) -> list[str]:
    """JSON files that are not named after a study."""
    known = {f"{name}.json" for name in STUDIES} | set(BESIDE)
    return sorted(path.name for path in folder.glob("*.json") if path.name not in known)


def _where(found: Mapping[str, Found], gaps: Gaps) -> str:
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
    return (
        f"<p>{escape(runs)}Every time stands beside its error.</p>"
        + "".join(lines)
        + _not_shown(gaps)
    )


def _not_shown(gaps: Gaps) -> str:
    """The gaps as a list, in front of everything."""
    items = "".join(f"<li>{escape(line)}</li>" for line in gaps.lines)
    return f'<div class="no"><p>Not shown, or not whole:</p><ul>{items}</ul></div>' if items else ""


def _first(rows: Mapping[str, Sequence[Row]], gaps: Gaps) -> str:
    return (
        "<p>Time and error of each kernel and of a peer in the same run, one thread. "
        "A ratio above 1 says that tauguard is faster.</p>"
        + (tables(kernels(rows, gaps), {}) or "<p>None of these studies is in this report.</p>")
    )


def _found(rows: Mapping[str, Sequence[Row]], gaps: Gaps) -> str:
    return (
        "<p>Collisions of arms that no threshold was set on, each figure with its 95 % interval. "
        "Simulated: thresholds that aim at 0.25 false alarms an hour. Real: pushes on a UR5.</p>"
        + (tables(detection(rows, gaps), {}) or "<p>None of these studies is in this report.</p>")
    )


def _pareto(rows: Mapping[str, Sequence[Row]], gaps: Gaps) -> str:
    drawn = [
        gaps.attempt(f"figure '{panel.title}'", partial(_drawn, panel), "")
        for panel in panels(rows, gaps)
    ]
    return (
        "<p>Left is fast, low is right. The grey line joins what nothing else beats in both. "
        "Circles are tauguard's, squares are peers of the same run.</p>"
        f'<div class="figures">{"".join(drawn)}</div>'
    )


def _drawn(panel: Panel) -> str:
    return picture(svg(panel).encode(), "svg+xml", panel.title)


def _missed(rows: Mapping[str, Sequence[Row]], gaps: Gaps) -> str:
    """Every bar of a study's closing summary that its run did not reach."""
    none: list[Row] = []
    bars = [
        bar
        for name, own in rows.items()
        for bar in gaps.attempt(f"bars of {name}", partial(_bars, name, own), none)
    ]
    lost = [{key: bar[key] for key in bar if key != "met"} for bar in bars if not bar["met"]]
    return f"<p>{len(bars) - len(lost)} of {len(bars)} bars are met.</p>" + tables(lost, {})


def _bars(name: str, rows: Sequence[Row]) -> list[Row]:
    return [
        {
            "bench": name,
            "what": row.get("question") or row.get("claim") or row.get("what"),
            "asked": row["asked"],
            "measured": row["measured"],
            "met": row["met"],
        }
        for row in rows
        if "asked" in row and isinstance(row.get("met"), bool)
    ]


def _costs(rows: Mapping[str, Sequence[Row]], gaps: Gaps) -> str:
    parts = [
        gaps.attempt(f"costs by {name}", partial(tables, own, _notes(name)), "")
        if own
        else f"<p>The study {name} is not in this report.</p>"
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


def _measured(found: Mapping[str, Found], failed: Mapping[str, str], others: Sequence[str]) -> str:
    runs = [
        {
            "bench": name,
            "question": STUDIES[name].line,
            "run": "quick" if one["quick"] else "full",
            "seed": one["seed"],
            "rows": len(one["rows"]),
            "load": one["machine"].get("load"),
        }
        for name, one in found.items()
    ]
    absent = [n + (f" ({failed[n]})" if n in failed else "") for n in STUDIES if n not in found]
    lost, beside = ", ".join(absent), ", ".join(others)
    return (
        "<p>A quick run shows the form of the answers, a full run their size. Of all quick studies "
        "two run at a time: their times are those of a busy machine. load: programs that wanted to "
        "run when the study ended; above the number of cores its times are too long.</p>"
        + tables(runs, {})
        + (f"<p>Not in this report: {escape(lost)}.</p>" if lost else "")
        + (f"<p>Files of no study, not read: {escape(beside)}.</p>" if beside else "")
    )


def _notes(name: str) -> Mapping[str, str]:
    notes: Mapping[str, str] = getattr(_module(name), "NOTES", {})
    return notes


def _module(name: str) -> Any:
    return importlib.import_module(f"studies.{STUDIES[name].module}")


def _study(name: str, found: Found, gaps: Gaps) -> str:
    study, rows = _module(name), found["rows"]
    missing = "<p>Not shown: see the top of this page.</p>"
    with warnings.catch_warnings(record=True) as raised:
        warnings.simplefilter("always", UserWarning)
        figure = gaps.attempt(
            f"chart of {name}",
            lambda: picture(chart(study, rows), "png", f"chart of {name}"),
            missing,
        )
    for line in dict.fromkeys(str(one.message) for one in raised):
        gaps.add(f"chart of {name}", line)  # an empty panel is no error to matplotlib
    shown: Callable[[list[Row]], list[Row]] = getattr(study, "shown", list)
    text = gaps.attempt(f"tables of {name}", lambda: tables(shown(rows), _notes(name)), missing)
    run = f"{'quick' if found['quick'] else 'full'} run, seed {found['seed']}"
    stopped = f"; incomplete: {found['incomplete']}" if "incomplete" in found else ""
    return (
        f"<p>{escape(STUDIES[name].line)} ({escape(run + stopped)}).</p>"
        f"<figure>{figure}</figure>" + folded("Tables", text)
    )
