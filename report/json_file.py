"""Figures as a JSON file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from tauguard.whole_file import write_whole


def write_json(path: Path, payload: Mapping[str, object]) -> None:
    """Write ``payload`` to a file, whole or not at all."""
    text = json.dumps(payload, indent=2, default=_plain, allow_nan=False) + "\n"
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path}: the folder {path.parent} does not exist")
    write_whole(path, text)


def _plain(value: object) -> object:
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no JSON form")
