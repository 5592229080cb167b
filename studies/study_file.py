"""The file of a study's figures, read and checked: whatever a folder holds under its name."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

#: What a file holds beside its rows, and of which type.
FIELDS: Mapping[str, type | tuple[type, ...]] = {
    "name": str,
    "quick": bool,
    "machine": dict,
    "versions": dict,
    "seed": (int, type(None)),
    "rows": list,
}
#: What it says of the machine.
MACHINE = ("processor", "cores", "system")


def read_study(path: Path, name: str) -> dict[str, Any]:
    """What :func:`studies.run.run_study` wrote of the study ``name``.

    Raises:
        ValueError: no figures of that study; the message says what is wrong with the file.
        OSError: it cannot be read.
    """
    try:
        found = json.loads(path.read_text())
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path.name} is no JSON file ({error})") from None
    wrong = _wrong(found, name)
    if wrong:
        raise ValueError(f"{path.name} is no file of this study: {wrong}")
    figures: dict[str, Any] = found
    return figures


def _wrong(found: Any, name: str) -> str | None:
    """What keeps ``found`` from being figures of the study ``name``."""
    if not isinstance(found, dict):
        return "it holds no object"
    for field, kind in FIELDS.items():
        if field not in found:
            return f"{field!r} is missing"
        if not isinstance(found[field], kind):
            return f"{field!r} is {found[field]!r:.40}"
    if found["name"] != name:
        return f"it says {found['name']!r:.40}"
    if any(key not in found["machine"] for key in MACHINE):
        return f"'machine' lacks one of {', '.join(MACHINE)}"
    if not all(isinstance(row, dict) for row in found["rows"]):
        return "a row is no object"
    return None
