"""Convert a drive to JSON text, which is attached to recordings, and back."""

import json
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from tauguard.findings import ArgumentError
from tauguard.models.drive import Drive, Friction, Ripple, Sensors

#: Version of the text; a reader refuses other versions.
VERSION = 1
_PARTS = {"friction": Friction, "ripple": Ripple, "sensors": Sensors}


def drive_text(drive: Drive) -> str:
    """``drive`` as JSON text, from which :func:`drive_of` makes an equal drive.

    The text leaves out the recorded errors of the model's current (``Sensors.left_over``), which
    no reader needs.
    """
    if drive.sensors is not None:
        drive = replace(drive, sensors=replace(drive.sensors, left_over=None))
    values = {"version": VERSION, **asdict(drive)}
    if drive.friction is not None and drive.friction.slope is None:
        del values["friction"]["slope"], values["friction"]["slope_velocity"]
    for name, default in (("left_over", None), ("rate", 0.0), ("jitter", 0.0)):
        if drive.sensors is not None and getattr(drive.sensors, name) == default:
            del values["sensors"][name]
    return json.dumps(values, sort_keys=True, default=_plain)


def drive_of(text: str) -> Drive:
    """The drive that :func:`drive_text` wrote.

    Raises:
        ArgumentError: the text is not of a drive, or is of another version (its number is named).
    """
    try:
        values: dict[str, Any] = json.loads(text)
        version = values.pop("version")
        if version != VERSION:
            raise ArgumentError(f"drive: of version {version}; this tauguard reads {VERSION}")
        for name, kind in _PARTS.items():
            if values[name] is not None:
                values[name] = kind(**_arrays(values[name]))
        return Drive(**_arrays(values))
    except (LookupError, TypeError, AttributeError, RecursionError, json.JSONDecodeError) as error:
        raise ArgumentError(f"drive: not the numbers of a drive ({error})") from None


def _plain(value: object) -> object:
    assert isinstance(value, np.ndarray)
    # A current limit may be infinite, and JSON has no infinity.
    return np.where(np.isfinite(value), value.astype(object), value.astype(str)).tolist()


def _arrays(values: dict[str, Any]) -> dict[str, Any]:
    known = (np.array(v, float) if isinstance(v, list) else v for v in values.values())
    return dict(zip(values, known, strict=True))
