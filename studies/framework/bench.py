"""``tauguard bench NAME``: measure parts of a study, judge, print and draw them."""

import importlib
import io
import math
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any

import tyro

from studies import STUDIES
from studies.framework.jobs import Workers
from studies.framework.pareto import draw_points
from studies.framework.rows import Incomplete, table_rows
from studies.framework.study import Part, all_parts, find, package
from tauguard.atomic_write import atomic_file
from tauguard.report import Row, measured, table, write_json
from tauguard.report.charts import STYLE
from tauguard.report.machine import load, load_line

#: Tables that are always printed.
SHORT = ("headline", "summary")


def command(
    name: Annotated[str, tyro.conf.Positional] = "all",
    /,
    quick: bool = False,
    seed: int = 0,
    detector: str | None = None,
    robot: str | None = None,
    keep: Path | None = None,
    alarms: Path | None = None,
    workers: int | None = None,
    tables: bool = False,
    json: Path | None = None,
    figure: Path | None = None,
    out: Path = Path("bench"),
) -> None:
    """Measure computing time and errors in a study, or in one part of it, and print them.

    The output states time and error of each method, and which targets are reached; `--tables`
    prints all tables.

    `tauguard bench all` runs every part of every study and writes figures and tables into a folder.
    Parts with results in the folder are not run again. `tauguard report` makes one page of these.

    Args:
        name: a study, or one part as STUDY-PART: `tauguard bench list` names them; or `all`.
        quick: a shorter run, 60 s or less per part on 2 cores (a full run takes up to 30 minutes).
        seed: seed of every random input.
        detector: module:Class of your own, an additional method of the studies `detection` and
            `real_arms-table`.
        robot: arms by name or file, separated by commas, for the parts that take any arm.
        keep: folder of the job cache. Jobs with results in the cache are not run again, unless
            versions or the sources of simulation and detectors have changed.
        alarms: folder with a card and alarms of a method on the benchmark's logs, for
            `real_arms-table`.
        workers: processes of the parts that use several (default: all processors).
        tables: print every table.
        json: write the rows here as JSON.
        figure: write the figure here (PNG; the default is bench-NAME.png in the working folder).
        out: the folder that `all` writes into.
    """
    if name == "list":
        _print_list()
        return
    if name == "all":
        from studies.framework.collect import collect

        if detector or robot or keep or alarms or workers or tables or json or figure:
            raise ValueError("bench all takes --quick, --seed and --out alone")
        if collect(out, all_parts(), quick=quick, seed=seed):
            raise SystemExit(1)
        return
    if workers is not None and workers < 1:
        raise ValueError(f"--workers {workers}: expected 1 or more")
    Workers.count = workers
    options = {"detector": detector, "robot": robot}
    options |= {"keep": str(keep) if keep else None, "alarms": str(alarms) if alarms else None}
    given = {option: value for option, value in options.items() if value is not None}
    chosen = _taking(find(name), given, name)
    for full, one in chosen.items():
        run_part(
            full,
            one,
            quick=quick,
            seed=seed,
            tables=tables,
            json_path=_own_path(json, full, chosen),
            figure_path=_own_path(figure, full, chosen) or Path(f"bench-{full}.png"),
            options={key: value for key, value in given.items() if key in one.options},
        )


def _print_list() -> None:
    for study in STUDIES:
        own = package(study).STUDY
        print(f"{study}: {own.line}")
        for name, one in own.parts.items():
            alias = f" ({one.alias})" if one.alias not in ("", name) else ""
            print(f"  {name}{alias}  {one.line}")


def _taking(parts: Mapping[str, Part], given: Mapping[str, str], name: str) -> Mapping[str, Part]:
    """The parts to run; with ``--detector`` or ``--robot``, only the parts that accept the flag."""
    for option in given:
        taking = {full: part for full, part in parts.items() if option in part.options}
        if not taking:
            names = [full for full, part in all_parts().items() if option in part.options]
            raise ValueError(f"--{option} goes with {', '.join(names)}, not with {name}")
        if option != "keep":
            parts = taking
    return parts


def _own_path(path: Path | None, full: str, parts: Mapping[str, Part]) -> Path | None:
    """The file of one part; if several parts run, the part's name is added."""
    if path is None or len(parts) == 1:
        return path
    return path.with_stem(f"{path.stem}-{full.partition('-')[2]}")


def run_part(
    name: str,
    part: Part,
    *,
    quick: bool,
    seed: int,
    tables: bool,
    json_path: Path | None,
    figure_path: Path,
    options: Mapping[str, str],
) -> None:
    """Run one part: print its tables, draw its figure, write its JSON.

    Raises:
        ValueError: bad input, or no folder to write into.
        Incomplete: some measurements failed; what the others found was printed and written.
        RuntimeError: the part failed by a defect.
    """
    for path in (figure_path, json_path):
        if path is not None and not path.parent.is_dir():
            raise ValueError(f"{path}: no folder {path.parent}; make it first")
    module, before = part.load(), load()
    rows, broken = _measured(module, quick, seed, options)
    if json_path is not None:  # first, so that an error in a table loses no measurements
        incomplete = {"incomplete": str(broken)} if broken else {}
        write_json(json_path, measured(name, rows, quick, seed) | incomplete)
    every, short = printed(module, rows), brief(module, rows)
    print(table(every if tables else short, notes=module.NOTES))
    if not tables and short != every:
        print("every table: --tables")
    print(load_line(before, load()))
    with atomic_file(figure_path) as stream:
        stream.write(chart(module, rows, figure_path.suffix[1:] or "png"))
    print(f"figure: {figure_path}")
    if json_path is not None:
        print(f"json: {json_path}")
    if broken is not None:
        raise broken


def _measured(
    module: ModuleType, quick: bool, seed: int, options: Mapping[str, str]
) -> tuple[list[Row], Incomplete | None]:
    """The part's rows with its summary, and the reason if some are missing."""
    try:
        rows, broken = module.measure(quick=quick, seed=seed, **options), None
    except Incomplete as stop:
        rows, broken = stop.rows, stop
    except ValueError as error:
        if _of_our_own(error):
            raise  # bad input, with a message of this project
        raise RuntimeError(f"{type(error).__name__}: {error}") from error
    return (rows + module.judge(rows) if hasattr(module, "judge") else rows), broken


def _of_our_own(error: BaseException) -> bool:
    """Whether code of this project raised the error in this process, not in a worker.

    An error of a worker is not about the input, which is checked before workers start.
    """
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    module = trace.tb_frame.f_globals.get("__name__", "") if trace is not None else ""
    remote = type(error.__cause__).__name__ == "RemoteTraceback"
    return not remote and module.partition(".")[0] in ("tauguard", "studies")


def printed(module: Any, rows: list[Row]) -> list[Row]:
    """The rows of a part that are printed: those of its ``table``, or all."""
    return list(module.table(rows)) if hasattr(module, "table") else rows


def brief(module: Any, rows: list[Row]) -> list[Row]:
    """The rows to print without ``--tables``: the points of the figure, and the summary.

    For a part without points, these are the rows of all tables.
    """
    make = getattr(importlib.import_module(module.__package__), "points", None)
    points = list(make(rows)) if make else []
    if not points:
        return printed(module, rows)
    return [
        {
            "study": own.question,
            "method": own.method,
            own.cost_axis: own.cost,
            own.error_axis: own.error_text if math.isnan(own.error) else own.error,
        }
        for own in points
    ] + [row for name in SHORT for row in table_rows(rows, name)]


def chart(module: Any, rows: list[Row], kind: str = "png") -> bytes:
    """The figure of a part's rows as a file of ``kind``, in the style of all figures."""
    import matplotlib
    from matplotlib.figure import Figure

    out = io.BytesIO()
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=getattr(module, "SIZE", None), layout="constrained")
        if hasattr(module, "draw"):
            module.draw(rows, figure)
        else:
            draw_points(importlib.import_module(module.__package__).points(rows), figure)
        figure.savefig(out, format=kind)
    return out.getvalue()
