"""The machine and the versions that results were measured with."""

import importlib.metadata
import os
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

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


def measured(
    name: str, rows: Sequence[Mapping[str, Any]], quick: bool = False, seed: int | None = None
) -> dict[str, Any]:
    """The content of a results file: rows, and the machine and versions that measured them."""
    return {
        "name": name,
        "quick": quick,
        "machine": machine(),
        "versions": versions(),
        "seed": seed,
        "rows": rows,
    }


#: A machine is busy if its load average per core exceeds this.
BUSY = 1.25


def machine() -> dict[str, Any]:
    """Processor, cores and system; ``load`` is :func:`load` at this moment."""
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        names = [line for line in info.read_text().splitlines() if line.startswith("model name")]
        model = names[0].split(":", 1)[1].strip() if names else model
    return {
        "processor": model,
        "cores": os.cpu_count(),
        "system": platform.system(),
        "load": load(),
    }


def load() -> float | None:
    """Load average of the last minute; None: unknown."""
    try:
        return round(os.getloadavg()[0], 1)
    except (AttributeError, OSError):  # a system without load averages
        return None


def load_line(begin: float | None, end: float | None) -> str:
    """One line on the machine's load, and whether it made the times unreliable.

    Args:
        begin: :func:`load` before the times were measured.
        end: :func:`load` after they were measured.
    """
    known = [each for each in (begin, end) if each is not None]
    if not known:
        return "load: not known here; times and their ratios hold for an idle machine"
    cores = os.cpu_count() or 1
    text = f"load: {begin} before, {end} after, {cores} core{'s' if cores > 1 else ''}"
    if max(known) <= BUSY * cores:
        return text
    return (
        f"{text}: busy machine: times are too long, and their ratios inaccurate; measure again on "
        "an idle machine; errors are not affected"
    )


def versions() -> dict[str, str]:
    """Versions of the measured packages that are installed."""
    found = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found
