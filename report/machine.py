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


def machine() -> dict[str, Any]:
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
