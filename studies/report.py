"""``tauguard report``: the studies and the hard cases in one HTML file."""

from __future__ import annotations

import sys
from pathlib import Path


def command(
    out: Path,
    quick: bool = False,
    seed: int = 0,
    study: tuple[str, ...] = (),
    bound: bool = False,
    mistakes: bool = True,
) -> None:
    """Run the studies that the folder does not hold yet, and bind them into `index.html`.

    A run that was broken off goes on where it stopped. The page opens offline. It also links to
    recordings of what the detector of `tauguard demo` gets wrong: `tauguard replay --web OUT`
    opens them. What cannot be shown is named on the page and here, with exit code 1.

    Args:
        out: the folder of the page and of each study's figures (JSON) and chart.
        quick: shorter runs, all of them together five to six minutes on 2 idle cores (full ones
            take up to 30 minutes each).
        seed: of every random input.
        study: these studies only (default: all that `tauguard bench list` names).
        bound: run no study, bind those that the folder holds.
        mistakes: train the detector of `tauguard demo` and record its mistakes, where the folder
            does not hold them of this build.
    """
    from studies import STUDIES
    from studies import mistakes as recorded
    from studies.bound import bind
    from studies.collect import collect
    from studies.gaps import Gaps
    from tauguard.hard_cases import adapters, load_cases, run
    from tauguard.report import write_json

    unknown = set(study) - STUDIES.keys()
    if unknown:
        raise ValueError(f"no study {min(unknown)!r}: there are {', '.join(STUDIES)}")
    failed = {}
    if not bound:
        failed = collect(out, study or tuple(STUDIES), quick=quick, seed=seed)
    elif not out.is_dir():
        raise ValueError(f"--bound --out {out}: no such folder")
    cases = run(load_cases(), adapters())
    write_json(out / "hard-cases.json", {"name": "hard-cases", "rows": cases})
    gaps = Gaps()
    links = gaps.attempt("mistakes", lambda: recorded.mistakes(out, seed), "") if mistakes else ""
    print(f"report: {bind(out, cases, failed, gaps, links)}")
    for line in gaps.lines:
        print(f"not shown, or not whole: {line}", file=sys.stderr)
    if failed or gaps.lines:
        raise SystemExit(1)
