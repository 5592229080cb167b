"""Write rows as a JSON file."""

import json
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from tauguard.atomic_write import write_atomic


def write_json(path: Path, payload: Mapping[str, object]) -> None:
    """Write ``payload`` to a file, completely or not at all.

    Numbers that are not finite become null.
    """
    text = json.dumps(_finite(payload), indent=2, allow_nan=False) + "\n"
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path}: the folder {path.parent} does not exist")
    write_atomic(path, text)


def _finite(value: object) -> object:
    """Convert to plain values; NaN and infinity become None."""
    if isinstance(value, np.ndarray | np.generic):
        return _finite(value.tolist())
    if isinstance(value, Mapping):
        return {key: _finite(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
