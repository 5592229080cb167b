"""The part of the report that shows what a detector got wrong, recording by recording."""

from __future__ import annotations

import json
from pathlib import Path

#: A collision that is found later than this is shown [s].
LATE = 0.05
#: Rows of each kind in the report; the folder's own page has all.
SHOWN = 8
#: Without `tauguard replay --web` nothing answers at these links: they become plain text.
OFFLINE = (
    "<script>if (location.protocol === 'file:') "
    "document.querySelectorAll('a[href^=\"open/\"]')"
    ".forEach(a => a.replaceWith(a.textContent))</script>"
)


def mistakes(folder: Path, seed: int) -> str:
    """HTML with a link for every collision missed or found late and every false alarm.

    The detector and the motions are those of `tauguard demo`. The recordings lie in
    ``folder/wrong``; they are made once.

    Args:
        folder: of the report.
        seed: of the arm and the motions.
    """
    from tauguard.report import write_json

    kept = folder / "wrong.json"
    if not kept.exists() or json.loads(kept.read_text())["seed"] != seed:
        write_json(kept, {"seed": seed, **judged(folder / "wrong", seed)})
    found = json.loads(kept.read_text())
    return _html(folder, found["counts"], found["rows"])


def judged(folder: Path, seed: int) -> dict[str, object]:
    """Train as `tauguard demo` does and record what goes wrong on its test motions."""
    from tauguard.cli.demo import FALSE_ALARMS_PER_HOUR
    from tauguard.cli.events import EventFolder
    from tauguard.datasets import demo_plan, simulate_all
    from tauguard.detectors import SrqSvr, match_detection, train
    from tauguard.detectors.calibration.nominal import nominal_arm

    plan = demo_plan(seed, "cura6")
    training = list(simulate_all(plan.train, None, "simulate training"))
    detector = train(SrqSvr(), training, nominal_arm(training), FALSE_ALARMS_PER_HOUR)
    wrong = EventFolder(folder, LATE)
    judged = simulate_all([*plan.judge_struck, *plan.judge_free], None, "simulate test")
    for number, trace in enumerate(judged):
        found = detector.detect(trace)
        wrong.add("test", number, match_detection(found, trace, detector.settle), (trace, found))
    wrong.finish()
    return {"counts": wrong.counts, "rows": wrong.rows}


def _html(folder: Path, counts: str, rows: list[dict[str, object]]) -> str:
    from tauguard.cli.events import KINDS
    from tauguard.report.page import Link, tables

    shown = [
        {**row, "file": Link(f"open/wrong/{row['file']}", str(row["file"]))}
        for kind in KINDS
        for row in [one for one in rows if one["kind"] == kind][:SHOWN]
    ]
    return (
        f"<p>The detector of <code>tauguard demo</code> on motions that it was not trained on: "
        f"{counts} (late: after {1e3 * LATE:.0f} ms). Each link opens its ten seconds in the "
        f"browser while <code>tauguard replay --web {folder}</code> shows this page.</p>"
        + tables(shown, {})
        + OFFLINE
    )
