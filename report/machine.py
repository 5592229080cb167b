"""What figures were measured on, and with which versions."""

from __future__ import annotations

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
    """Rows as they go into a file: with what they were measured on."""
    return {
        "name": name,
        "quick": quick,
        "machine": machine(),
        "versions": versions(),
        "seed": seed,
        "rows": rows,
    }


#: Programs that want to run, over the cores, above which times are those of a busy machine.
BUSY = 1.25


def machine() -> dict[str, Any]:
    """What the figures were measured on; ``load``: see :func:`load`, when this is asked."""
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
    """Programs that wanted to run over the last minute, this one among them; None: not known."""
    try:
        return round(os.getloadavg()[0], 1)
    except (AttributeError, OSError):  # Windows, or a system that does not say
        return None


def load_line(begin: float | None, end: float | None) -> str:
    """What a reader of times must know of the load, in one line.

    Args:
        begin: :func:`load` before the times were measured.
        end: the same after it.
    """
    known = [each for each in (begin, end) if each is not None]
    if not known:
        return "load: not known here; times and their ratios hold for an idle machine"
    cores = os.cpu_count() or 1
    text = f"load: {begin} before, {end} after, {cores} core{'s' if cores > 1 else ''}"
    if max(known) <= BUSY * cores:
        return text
    return f"{text}: a busy machine; do not trust times and ratios of times, errors hold"


def versions() -> dict[str, str]:
    """The versions of what was measured; a package that is not installed is left out."""
    found = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found
