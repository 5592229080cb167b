"""``tauguard report``: the parts of a folder and the hard cases in one HTML file."""

import json
import math
import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from html import escape
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

from studies import STUDIES
from studies.framework.bench import chart, printed
from studies.framework.collect import collect, read_rows
from studies.framework.headlines import headlines
from studies.framework.pareto import svg
from studies.framework.rows import Point, groups
from studies.framework.study import Part, all_parts, find, package
from tauguard.atomic_write import write_atomic
from tauguard.report import Row, versions, write_json
from tauguard.report.page import folded, page, picture, tables

#: Other JSON files that the folder of a report holds.
BESIDE = ("hard-cases.json", "wrong.json")
#: Units of time and how many microseconds each is.
UNITS = (("s", 1e6), ("ms", 1e3), ("µs", 1.0), ("ns", 1e-3))
#: Largest length of a line about a missing part.
LENGTH = 300

#: Text of the page.
EMPTY = "<p>Not shown: see the top of this page.</p>"
NONE = "<p>None of these studies is in this report.</p>"
BESIDE_WHOM = (
    "<p>Time and error of each method and of another library in the same run, one thread. "
    "A ratio above 1 means that tauguard is faster.</p>"
)
DETECTIONS = (
    "<p>Collisions of arms on which no threshold was set; every number has its 95 % interval. "
    "Simulated arms: thresholds for 0.25 false alarms per hour. Real arms: pushes.</p>"
)
FIGURES = (
    "<p>Points further left are faster, lower points are more accurate. The grey line joins the "
    "points that no other point surpasses in both. Circles are methods of tauguard, squares are "
    "other libraries in the same run.</p>"
)
RUNS = (
    "Numbers of a quick run are rough; two quick parts run at the same time. load: number of "
    "running programs at the end of a part; if it exceeds the number of cores, times are too long."
)
UNRECORDED = (
    "<p>Not recorded in a quick run; <code>tauguard report --bound</code> records them.</p>"
)
CASES = (
    "<p>Named cases with exact answers, run on every installed library; "
    "<code>tauguard hard-cases</code> runs them, also on your own library. "
    "Right answers, of the cases that each library supports:</p>"
)

T = TypeVar("T")


def command(
    out: Path,
    quick: bool = False,
    seed: int = 0,
    study: tuple[str, ...] = (),
    bound: bool = False,
    mistakes: bool = True,
) -> None:
    """Run the studies without results in the folder, and write all results to `index.html`.

    A stopped run continues where it stopped. The page opens offline. A full run also records the
    mistakes of `tauguard demo`'s detector; `tauguard replay --web OUT` shows them. If something
    cannot be shown, the page and a message name it, and the exit code is 1.

    Args:
        out: the folder of the page and of each part's rows (JSON) and figure.
        quick: shorter runs, all of them together five to six minutes on 2 idle cores (full ones
            take up to 30 minutes each).
        seed: seed of every random input.
        study: these studies or parts only (default: all that `tauguard bench list` names).
        bound: write the page from results in the folder; run no study and no hard case.
        mistakes: train the detector of `tauguard demo` and record its mistakes, unless the folder
            contains mistakes of this build; a quick run records none.
    """
    from studies.framework import mistakes as recorded
    from tauguard.hard_cases import adapters, load_cases, run

    asked = {full for name in study for full in find(name)} or set(all_parts())
    failed: Mapping[str, str] = {}
    missing, kept = Missing(), out / "hard-cases.json"
    if not bound:
        failed = collect(out, [n for n in all_parts() if n in asked], quick=quick, seed=seed)
    elif not out.is_dir():
        raise ValueError(f"--bound --out {out}: no such folder")
    found: dict[str, Any] = {"rows": []}
    if kept.exists():
        found = missing.attempt("hard cases", lambda: json.loads(kept.read_text()), found)
    if not bound and found.get("versions") != versions():
        rows = run(load_cases(), adapters())
        found = {"name": kept.stem, "versions": versions(), "rows": rows}
        write_json(kept, found)
    cases, links = found["rows"], ""
    if quick:
        links = UNRECORDED
    elif mistakes:
        links = missing.attempt("mistakes", lambda: recorded.mistakes(out, seed), "")
    print(f"report: {Report(out, failed, missing).write(cases, links)}")
    for line in missing.lines:
        print(f"not shown, or not whole: {line}", file=sys.stderr)
    if failed or missing.lines:
        raise SystemExit(1)


class Missing:
    """Lines that say what the page cannot show, and why."""

    def __init__(self) -> None:
        """Start with no lines."""
        self.lines: list[str] = []

    def add(self, what: str, why: str) -> None:
        """Add a line that names a part and why it is missing, without control characters."""
        text = " ".join(f"{what}: {why}".split())
        self.lines.append("".join(c if c.isprintable() else "?" for c in text)[:LENGTH])

    def attempt(self, what: str, make: Callable[[], T], instead: T) -> T:
        """Return what ``make`` returns. If it raises, add a line and return ``instead``."""
        try:
            return make()
        except KeyError as error:
            self.add(what, f"no {error} in its rows")
        except Exception as error:  # the file may come from another build or another program
            self.add(what, f"{type(error).__name__}: {error}")
        return instead


class Report:
    """The page of a folder; it names files that are damaged or come from another program."""

    def __init__(self, folder: Path, failed: Mapping[str, str], missing: Missing) -> None:
        """Read the files of ``folder``; ``failed`` says why a part has none."""
        self.folder, self.failed, self.missing = folder, failed, missing
        self.parts, self.found = all_parts(), {}
        for name in self.parts:
            path = folder / f"{name}.json"
            if name in failed or not path.exists():
                continue
            try:
                one = self.found[name] = read_rows(path, name)
            except (OSError, ValueError) as error:
                missing.add(name, str(error))
                continue
            if not one["rows"] or "incomplete" in one:
                missing.add(name, f"incomplete: {one.get('incomplete', 'its file has no rows')}")

    def write(self, cases: Sequence[Row], mistakes: str) -> Path:
        """Write ``index.html`` with rows of the hard cases and ``mistakes``, HTML with links."""
        points, attempt = self._of_studies("points"), self.missing.attempt
        bodies = {f"Study: {name}": self._part(name, self.parts[name]) for name in self.found}
        detections = tables(self._of_studies("detections"), {}) or NONE
        first = attempt("first screen", lambda: headlines(points, self._of_studies("found")), "")
        sections = {
            "How fast, how wrong, beside whom": attempt("first table", lambda: _beside(points), ""),
            "Collisions found, false alarms": DETECTIONS + detections,
            "Error against microseconds": self._figures(points),
            "Asked and not reached": self._not_reached(),
            "Hard cases": attempt("hard cases", lambda: _cases(cases), "") if cases else "",
            "Mistakes to look at": mistakes,
            **bodies,
            "Machine and versions": self._machines(),
        }
        target = self.folder / "index.html"
        write_atomic(target, page("tauguard: speed against error", sections, first + self._gaps()))
        return target

    def _of_studies(self, function: str) -> list[Any]:
        """Call a function of each study's package with the rows of its parts; join the results."""
        found: list[Any] = []
        for study in STUDIES:
            own = [one for name, one in self.found.items() if name.startswith(f"{study}-")]
            rows = [row for one in own for row in one["rows"]]
            make = getattr(package(study), function, None)
            if make and rows:
                listed = partial(lambda call, given: found.extend(call(given)), make, rows)
                self.missing.attempt(f"first page, {study}", listed, None)
        return found

    def _figures(self, points: Sequence[Point]) -> str:
        drawn = []
        shown = [point for point in points if not math.isnan(point.error)]
        for question, own in groups(shown, lambda point: point.question).items():
            code = self.missing.attempt(f"figure {question!r}", partial(svg, own), "")
            drawn.append(picture(code.encode(), "svg+xml", question) if code else "")
        return f'{FIGURES}<div class="figures">{"".join(drawn)}</div>'

    def _not_reached(self) -> str:
        """The lines of all summaries in which the wanted value was not reached."""
        rows = [(name, row) for name, one in self.found.items() for row in one["rows"]]
        judged = [(n, r) for n, r in rows if "asked" in r and isinstance(r.get("met"), bool)]
        lost = [
            {
                "part": name,
                "what": row.get("question") or row.get("claim") or row.get("what"),
                "asked": row["asked"],
                "measured": row.get("measured"),
            }
            for name, row in judged
            if not row["met"]
        ]
        met = len(judged) - len(lost)
        return f"<p>{met} of {len(judged)} targets are reached.</p>" + tables(lost, {})

    def _part(self, name: str, part: Part) -> str:
        one, module = self.found[name], part.load()
        rows = one["rows"]
        figure = self._figure(name, module) if hasattr(module, "draw") else ""
        text = self.missing.attempt(
            f"tables of {name}", lambda: tables(printed(module, rows), module.NOTES), EMPTY
        )
        load = one["machine"].get("load")
        kind = "quick" if one["quick"] else "full"
        run = f"{part.line} ({kind} run, seed {one['seed']}, load {load})."
        return f"<p>{escape(run)}</p>{figure}" + folded("Tables", text)

    def _figure(self, name: str, module: ModuleType) -> str:
        """The part's own figure; the first page has the figures of ``points``."""
        what, rows = f"figure of {name}", self.found[name]["rows"]
        with warnings.catch_warnings(record=True) as raised:
            warnings.simplefilter("always", UserWarning)
            drawn = self.missing.attempt(what, lambda: chart(module, rows), b"")
        for line in dict.fromkeys(str(warning.message) for warning in raised):
            self.missing.add(what, line)  # matplotlib draws an empty panel
        return f"<figure>{picture(drawn, 'png', what)}</figure>" if drawn else EMPTY

    def _machines(self) -> str:
        """Machines and versions in paragraphs, and files of the folder that are no study's."""
        machines: dict[str, list[str]] = {}
        for name, one in self.found.items():
            on = one["machine"]
            with_what = ", ".join(f"{package} {v}" for package, v in one["versions"].items())
            text = f"{on['processor']}, {on['cores']} cores, {on['system']}: {with_what}"
            machines.setdefault(text, []).append(name)
        lines = [f"{len(self.found)} of {len(self.parts)} parts of studies. {RUNS}"]
        for text, names in machines.items():
            lines.append(text + (f" ({', '.join(names)})." if len(machines) > 1 else "."))
        known = {f"{name}.json" for name in self.parts} | set(BESIDE)
        others = sorted(p.name for p in self.folder.glob("*.json") if p.name not in known)
        lines += [f"Files of no study, not read: {', '.join(others)}."] if others else []
        return "".join(f"<p>{escape(line)}</p>" for line in lines)

    def _gaps(self) -> str:
        """The list of missing parts, as HTML."""
        absent = [
            name + (f" ({self.failed[name]})" if name in self.failed else "")
            for name in self.parts
            if name not in self.found
        ]
        text = f"<p>Not in this report: {escape(', '.join(absent))}.</p>" if absent else ""
        items = "".join(f"<li>{escape(line)}</li>" for line in self.missing.lines)
        ending = f'<div class="no"><p>Not shown, or not whole:</p><ul>{items}</ul></div>'
        return text + (ending if items else "")


def time_text(us: float) -> str:
    """A time as text: three digits and a unit."""
    unit, size = next(((u, s) for u, s in UNITS if us >= s), UNITS[-1])
    return f"{us / size:.3g} {unit}"


def _beside(points: Sequence[Point]) -> str:
    """A line for each question: times and errors of tauguard and peer, and the ratio of times."""
    lines = [
        {
            "what": ours.question,
            "tauguard takes": time_text(ours.cost),
            "tauguard's error": ours.error_text,
            "peer": peer.method,
            "peer takes": time_text(peer.cost),
            "peer's error": peer.error_text,
            "peer / tauguard": f"{peer.cost / ours.cost:.3g}",
        }
        for own in groups(points, lambda point: point.question).values()
        for ours in own
        if ours.role == "ours"
        for peer in own
        if peer.role == "peer" and peer.error_text
    ]
    return BESIDE_WHOM + (tables(lines, {}) or NONE)


def _cases(rows: Sequence[Row]) -> str:
    from tauguard.hard_cases.verdicts import by_library

    columns = ("case", "expected", "answer", "why", "explained")
    wrong = [row for row in rows if not row["right"] and row["library"] == "tauguard"]
    ours = tables([{key: row[key] for key in columns} for row in wrong], {})
    every = [{k: row[k] for k in ("library", *columns[:-1], "right", "origin")} for row in rows]
    return (
        CASES
        + tables(by_library(rows), {})
        + (f"<p>What tauguard answers wrongly:</p>{ours}" if wrong else "")
        + folded(f"All {len(rows)} answers", tables(every, {}))
    )
