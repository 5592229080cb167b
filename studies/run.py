"""The run of a study: its table, its figure, its JSON."""

from __future__ import annotations

import difflib
import importlib
import io
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from studies import SLOW_TESTS, STUDIES
from studies.harness import Incomplete
from tauguard.atomic_write import atomic_file
from tauguard.report import Row, measured, table, write_json
from tauguard.report.charts import STYLE
from tauguard.report.machine import load, load_line


def run_study(
    name: str,
    *,
    quick: bool,
    seed: int,
    json_path: Path | None,
    figure_path: Path | None,
    more: Mapping[str, str] | None = None,
) -> list[Row]:
    """Run the study ``name``: print its table, draw its figure, write its JSON.

    ``more`` holds keywords that this study alone takes.

    Raises:
        ValueError: no such study (the message names the nearest, or those there are), or no folder
            to write the figure or the JSON into.
        Incomplete: parts of the study failed; what the others found was printed and written.
        RuntimeError: the study failed by a defect.
    """
    if name not in STUDIES:
        raise ValueError(_no_study(name))
    figure_path = figure_path or Path(f"bench-{name}.png")
    for path in (figure_path, json_path):
        if path is not None and not path.parent.is_dir():
            raise ValueError(f"{path}: no folder {path.parent}; make it first")
    study = importlib.import_module(f"studies.{STUDIES[name].module}")
    before = load()
    rows, broken = _rows(study, quick, seed, more or {})
    shown: Callable[[list[Row]], list[Row]] | None = getattr(study, "shown", None)
    print(table(shown(rows) if shown else rows, notes=getattr(study, "NOTES", {})))
    print(load_line(before, load()))

    with atomic_file(figure_path) as stream:
        stream.write(chart(study, rows, figure_path.suffix[1:] or "png"))
    print(f"figure: {figure_path}")
    if json_path is not None:
        incomplete = {"incomplete": str(broken)} if broken else {}
        write_json(json_path, measured(name, rows, quick, seed) | incomplete)
        print(f"json: {json_path}")
    if broken is not None:
        raise broken
    return rows


def _no_study(name: str) -> str:
    """What to type instead."""
    if name in SLOW_TESTS:
        return (
            f"{name} is a slow test now: run `pytest -m slow -k {SLOW_TESTS[name]}` in a checkout"
        )
    near = difflib.get_close_matches(name, STUDIES, n=1, cutoff=0.75)
    if near:
        return f"no study {name!r}: did you mean {near[0]}? (`tauguard bench list` has all)"
    return f"no study {name!r}: there are {', '.join(STUDIES) or 'none yet'}"


def chart(study: Any, rows: list[Row], kind: str = "png") -> bytes:
    """The chart of a study's rows as a file of ``kind``, in the style of all charts."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    out = io.BytesIO()
    with plt.rc_context(STYLE):
        figure = plt.figure(figsize=getattr(study, "SIZE", None), layout="constrained")
        study.draw(rows, figure)
        figure.savefig(out, format=kind)
        plt.close(figure)
    return out.getvalue()


def _rows(
    study: Any, quick: bool, seed: int, more: Mapping[str, str]
) -> tuple[list[Row], Incomplete | None]:
    """The study's rows, and why there are not all of them."""
    try:
        return study.run(quick=quick, seed=seed, **more), None
    except Incomplete as stop:
        return stop.rows, stop
    except ValueError as error:
        if _of_our_own(error):
            raise  # bad input, in our words
        raise RuntimeError(f"{type(error).__name__}: {error}") from error


def _of_our_own(error: BaseException) -> bool:
    """Whether our code raised it, in this process: workers start when the input is known to do."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    module = trace.tb_frame.f_globals.get("__name__", "") if trace is not None else ""
    remote = type(error.__cause__).__name__ == "RemoteTraceback"
    return not remote and module.partition(".")[0] in ("tauguard", "studies")
