"""Figures as a JSON file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np


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
