"""``tauguard bench NAME``: one study of speed against error, or all of them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro

#: Studies that keep what they have done in a folder.
KEEPING = (
    "guard",
    "entries",
    "detection",
    "detection_parts",
    "detection_ladder",
    "false_alarms",
)


def command(
    name: Annotated[str, tyro.conf.Positional] = "all",
    /,
    quick: bool = False,
    seed: int = 0,
    detector: str | None = None,
    robot: str | None = None,
    keep: Path | None = None,
    json: Path | None = None,
    figure: Path | None = None,
    out: Path = Path("bench"),
) -> None:
    """Run one study of speed against error and print its table, or all of them.

    All of them leave their figures, charts and tables in a folder; those that it holds already are
    not run again. `tauguard report` binds the folder into one page.

    Args:
        name: the study: one of those `tauguard bench list` names, or `all`.
        quick: a shorter run, 60 s or less on 2 cores (the full one takes up to 30 minutes).
        seed: of every random input.
        detector: a method of your own as module:Class, beside those of the study `detection`.
        robot: arms of the studies `arms` and `detection`, by name or file, parted by commas.
        keep: folder for what `guard`, `entries`, `detection`, `detection_parts`,
            `detection_ladder` and `false_alarms` have done; what it holds is not done again. The
            last four leave results of other versions, or of other sources of simulation and
            detectors, alone and do not use them.
        json: write the figures here as JSON.
        figure: write the chart here (PNG; the default is bench-NAME.png in the working folder).
        out: the folder of all studies.
    """
    from studies import STUDIES
    from studies.collect import collect
    from studies.run import run_study

    if name == "list":
        for name, study in STUDIES.items():
            print(f"  {name}  {study.line}")
        return
    if detector is not None and name != "detection":
        raise ValueError(f"--detector goes with the study detection, not with {name}")
    if robot is not None and name not in ("arms", "detection"):
        raise ValueError(f"--robot goes with the studies arms and detection, not with {name}")
    if keep is not None and name not in KEEPING:
        raise ValueError(f"--keep goes with the studies {', '.join(KEEPING)}, not with {name}")
    given = {"detector": detector, "robot": robot, "keep": None if keep is None else str(keep)}
    more = {key: value for key, value in given.items() if value is not None}
    if name == "all":
        if json is not None or figure is not None:
            raise ValueError("json, figure: of one study; all of them go to the folder --out")
        if collect(out, STUDIES, quick=quick, seed=seed):
            raise SystemExit(1)
        return
    run_study(name, quick=quick, seed=seed, json_path=json, figure_path=figure, more=more)
