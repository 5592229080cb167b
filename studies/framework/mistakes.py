"""The report's section on a detector's errors, with recordings."""

import json
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import quote

from studies.framework.jobs import build
from tauguard.replay.event_page import OFFLINE
from tauguard.report import write_json

#: Delay beyond which a collision is shown as late [s].
LATE = 0.05
#: Rows of each kind in the report; the folder's own page has all.
SHOWN = 8


def mistakes(folder: Path, seed: int) -> str:
    """HTML with a link for every collision missed or found late and every false alarm.

    The detector and the motions are those of `tauguard demo`. The recordings are in
    ``folder/wrong``, their list in ``folder/wrong.json``. If they are of another seed or build,
    a message says so and they are made again.
    """
    kept = folder / "wrong.json"
    found, why = _kept(kept, seed)
    if why:
        print(f"mistakes: {why}; training the detector of the demo takes minutes", flush=True)
        found = {"seed": seed, "build": build(), **judged(folder / "wrong", seed)}
        write_json(kept, found)
    return _html(folder, found["counts"], found["rows"])


def _kept(path: Path, seed: int) -> tuple[dict[str, Any], str]:
    """The existing list, and the reason to make it again (empty: it is valid)."""
    if not path.exists():
        return {}, "none are recorded yet"
    try:
        found = json.loads(path.read_text())
        own = {"seed": found["seed"], "build": found.get("build")}
        files = [Path(row["file"]) for row in found["rows"] if row["kind"]]
        found["counts"] = str(found["counts"])
    except (ValueError, RecursionError, KeyError, TypeError, AttributeError):
        raise ValueError(
            f"{path}: not a list of mistakes that this command wrote; move it away"
        ) from None
    if own != {"seed": seed, "build": build()}:
        return {}, "those recorded are of another seed or build"
    if not all((path.with_suffix("") / file.name).is_file() for file in files):
        return {}, "some recordings are gone"
    return found, ""


def judged(folder: Path, seed: int) -> dict[str, object]:
    """Train as `tauguard demo` does, and record the errors on its test motions."""
    from tauguard.cli.demo import FALSE_ALARMS_PER_HOUR
    from tauguard.datasets import demo_plan, simulate_all
    from tauguard.detectors import SrqSvr, match_detection
    from tauguard.detectors.alarms.training import train
    from tauguard.detectors.calibration.nominal import nominal_arm
    from tauguard.replay.events import EventFolder

    plan = demo_plan(seed, "cura6")
    training = list(simulate_all(plan.train, None, "simulate training"))
    detector = train(SrqSvr(), training, nominal_arm(training), FALSE_ALARMS_PER_HOUR)
    wrong = EventFolder(folder, LATE, detector)
    judged = simulate_all([*plan.judge_struck, *plan.judge_free], None, "simulate test")
    for number, trace in enumerate(judged):
        found = detector.detect(trace)
        wrong.add(str(number), match_detection(found, trace, detector.settle), (trace, found))
    wrong.finish()
    return {"counts": wrong.counts, "rows": wrong.rows}


def _html(folder: Path, counts: str, rows: list[dict[str, Any]]) -> str:
    from tauguard.replay.event_page import definitions
    from tauguard.replay.events import KINDS, command_to_open
    from tauguard.report.page import Link, tables

    chosen = [row for kind in KINDS for row in [r for r in rows if r["kind"] == kind][:SHOWN]]
    address = {row["file"]: f"open/wrong/{quote(str(row['file']))}" for row in chosen}
    shown = [{**r, "file": Link(address[r["file"]], str(r["file"]))} for r in chosen]
    opens = escape(command_to_open(folder))
    return (
        f"<p>The detector of <code>tauguard demo</code> on motions that it was not trained on: "
        f"{escape(counts)}. Each link opens its ten seconds in the browser while "
        f"<code>{opens}</code> shows this page.</p>"
        + tables(shown, {})
        + _pictures(folder / "wrong", chosen)
        + f"<h4>What the words mean</h4>{definitions(LATE)}"
        + OFFLINE
    )


def _pictures(folder: Path, rows: list[dict[str, Any]]) -> str:
    """A figure for the first mistake of each kind: the score and its threshold."""
    from tauguard.report.page import picture

    first: dict[str, Path] = {}
    for row in rows:
        first.setdefault(row["kind"], folder / Path(row["file"]).with_suffix(".png").name)
    return "".join(
        f"<figure>{picture(file.read_bytes(), 'png', f'{kind}: score and threshold')}</figure>"
        for kind, file in first.items()
        if file.is_file()
    )
