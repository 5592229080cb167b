"""What every study shares: rates with intervals, timings with spread, the run of a study, JSON."""

from __future__ import annotations

import importlib
import importlib.metadata
import json
import os
import platform
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tauguard.benchmarks import STUDIES
from tauguard.benchmarks.text_table import table

Row = dict[str, Any]

_PACKAGES = (
    "tauguard",
    "mujoco",
    "pin",
    "coal",
    "numpy",
    "scipy",
    "scikit-learn",
    "gymnasium",
    "ipctk",
)


def rate(successes: int, trials: int) -> dict[str, float | int | None]:
    """A proportion with its Wilson 95 % interval (Wilson 1927); all ``None`` where n is 0."""
    if trials == 0:
        return {"value": None, "low": None, "high": None, "n": 0}
    z = 1.959963984540054
    p = successes / trials
    centre = (p + z * z / (2 * trials)) / (1 + z * z / trials)
    half = z / (1 + z * z / trials) * np.sqrt(p * (1 - p) / trials + z * z / (4 * trials**2))
    low = 0.0 if successes == 0 else max(0.0, float(centre - half))
    high = 1.0 if successes == trials else min(1.0, float(centre + half))
    return {"value": p, "low": low, "high": high, "n": trials}


def timed(met: bool, quick: bool) -> bool | str:
    """Whether a timing meets its bar; few repeats of small cases can say yes, but not no."""
    return "full run" if quick and not met else bool(met)


def answer(question: str, asked: str, measured: str, met: bool | str | None = None) -> Row:
    """A line of a study's closing summary; ``met`` is ``None`` where a figure has no bar."""
    return {
        "study": "summary",
        "question": question,
        "asked": asked,
        "measured": measured,
        "met": met if met is None or isinstance(met, str) else bool(met),
    }


def measure(
    calls: Mapping[str, Callable[[], object]],
    repeats: int = 5,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[str, dict[str, float]]:
    """Seconds of each call, the calls taken in turn (A B A B ...) after one warm-up each.

    Taking turns lets a drift of the machine's speed hit every competitor alike. Work of a single
    thread may be timed by ``time.process_time``, which leaves out what other programs take.

    Returns:
        Per name ``{"median", "low", "high"}``: median, minimum and maximum over the repeats [s].
    """
    for call in calls.values():
        call()
    times: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(repeats):
        for name, call in calls.items():
            start = clock()
            call()
            times[name].append(clock() - start)
    return {
        name: {"median": float(np.median(t)), "low": min(t), "high": max(t)}
        for name, t in times.items()
    }


def machine() -> Row:
    """What the figures were measured on."""
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        names = [line for line in info.read_text().splitlines() if line.startswith("model name")]
        model = names[0].split(":", 1)[1].strip() if names else model
    return {"processor": model, "cores": os.cpu_count(), "system": platform.system()}


def versions() -> dict[str, str]:
    """The versions of what was measured; a package that is not installed is left out."""
    found = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found


def write_json(path: Path, payload: Mapping[str, object]) -> None:
    """Write ``payload`` so that a reader never sees half a file (temporary file, then rename)."""
    text = json.dumps(payload, indent=2, default=_plain, allow_nan=False) + "\n"
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path}: the folder {path.parent} does not exist")
    part = path.with_name(path.name + ".part")
    part.write_text(text)
    part.replace(path)


def _plain(value: object) -> object:
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no JSON form")


def run_study(
    name: str, *, quick: bool, seed: int, json_path: Path | None, figure_path: Path | None
) -> list[Row]:
    """Run the study ``name``: print its table, draw its figure, write its JSON.

    Raises:
        ValueError: no such study; the message lists those there are.
    """
    if name not in STUDIES:
        raise ValueError(f"no study {name!r}: there are {', '.join(STUDIES) or 'none yet'}")
    study = importlib.import_module(f"tauguard.benchmarks.{name}")
    rows: list[Row] = study.run(quick=quick, seed=seed)
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
