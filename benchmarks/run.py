"""The run of a study: its table, its figure, its JSON."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from pathlib import Path

from tauguard.benchmarks import STUDIES
from tauguard.report import Row, machine, table, versions, write_json


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
        ValueError: no such study; the message lists those there are.
    """
    if name not in STUDIES:
        raise ValueError(f"no study {name!r}: there are {', '.join(STUDIES) or 'none yet'}")
    study = importlib.import_module(f"tauguard.benchmarks.{STUDIES[name].module}")
    rows: list[Row] = study.run(quick=quick, seed=seed, **(more or {}))
    shown: Callable[[list[Row]], list[Row]] | None = getattr(study, "shown", None)
    print(table(shown(rows) if shown else rows, notes=getattr(study, "NOTES", {})))

    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure_path = figure_path or Path(f"bench-{name}.png")
    figure = plt.figure(figsize=(11, 7), layout="constrained")
    study.draw(rows, figure)
    figure.savefig(figure_path, dpi=120)
    plt.close(figure)
    print(f"figure: {figure_path}")
    if json_path is not None:
        write_json(
            json_path,
            {
                "name": name,
                "quick": quick,
                "machine": machine(),
                "versions": versions(),
                "seed": seed,
                "rows": rows,
            },
        )
        print(f"json: {json_path}")
    return rows
