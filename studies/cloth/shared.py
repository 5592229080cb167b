"""Helpers of the cloth study: frames, recorded data, ipctk, units of time."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oracles.recorded_collisions import FRAMES, KINDS, QUERY_SETS
from studies.framework import table_rows
from tauguard.cloth.scenes import Scene
from tauguard.report import Row

#: Positions (V, 3) at both ends of a step [m].
Step = tuple[NDArray[np.float64], NDArray[np.float64]]

#: The generated cloths; the other generated scenes are of rigid bodies or solids.
CLOTHS = ("pleats", "turning_ball", "seated_skirt", "twisting_mats", "crumpling")


def step_at(scene: Scene, moment: float) -> Step:
    """Positions at both ends of the scene's step that starts at about ``moment`` in [0, 1)."""
    first = min(round(moment * scene.frames), scene.frames - 1)
    return scene.positions(first / scene.frames), scene.positions((first + 1) / scene.frames)


def load_ipctk() -> Any:
    """ipctk with one thread and without warnings, or ``None`` where it is not installed."""
    try:
        import ipctk
    except ImportError:
        return None
    ipctk.set_num_threads(1)
    ipctk.set_logger_level(ipctk.LoggerLevel.error)
    return ipctk


def narrow_phases(ipctk: Any) -> dict[str, Any]:
    """The compared methods of ipctk, by name."""
    return {
        "AdditiveCCD": ipctk.AdditiveCCD(),
        "TightInclusionCCD": ipctk.TightInclusionCCD(conservative_rescaling=1.0),
    }


def run_row(quick: bool, **settings: object) -> Row:
    """The row with a part's settings; times are processor times, as median [least, most]."""
    return {"study": "run", "run": "quick" if quick else "full", **settings}


def is_quick(rows: Sequence[Row]) -> bool:
    """Whether the rows are those of a quick run."""
    return any(row["run"] == "quick" for row in table_rows(rows, "run"))


def recorded() -> Path | None:
    """The folder in ``TAUGUARD_DATA``; ``None`` if the variable is not set.

    Raises:
        ValueError: the folder lacks recorded frames or labelled queries.
    """
    named = os.environ.get("TAUGUARD_DATA")
    if not named:
        return None
    folder = Path(named) / "ccd"
    needed = [f"{name}/{part}" for name in FRAMES for part in ("frames", "boxes", "mma_bool")]
    needed += [f"{name}/{kind}" for name in QUERY_SETS for kind in KINDS]
    missing = [name for name in needed if not any((folder / name).glob("*.*"))]
    if missing:
        raise ValueError(
            f"TAUGUARD_DATA: {folder} lacks files in {', '.join(missing)}; "
            "docs/notes/cloth.md names their origin (unset: no recorded data)"
        )
    return Path(named)
