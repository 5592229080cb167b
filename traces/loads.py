"""The load that an arm carries, and the values that stand for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from tauguard.findings import ArgumentError, cause


@dataclass(frozen=True)
class Load:
    """Mass and centre of mass of the load that the arm carried; the centre may be unknown."""

    heaviest: ClassVar[float] = 100.0
    """Largest mass that :func:`load_of` accepts [kg]; a larger number probably means grams."""

    mass: float = 0.0  #: [kg]
    centre: tuple[float, float, float] | None = None
    """In the last link's frame [m]. None: unknown; it is identified with the arm's parameters."""

    def __post_init__(self) -> None:
        """``ArgumentError`` for a mass below 0 or numbers that are not finite."""
        if not (np.isfinite(self.mass) and self.mass >= 0):
            raise ArgumentError(f"load: {self.mass} kg, expected 0 or more")
        if self.centre is not None and not (
            len(self.centre) == 3 and np.isfinite(self.centre).all()
        ):
            raise ArgumentError(f"load: centre {self.centre}, expected three finite numbers [m]")


#: A load: kg, or kg and its centre in the last link's frame [m]; None: unknown.
LoadLike = Load | float | tuple[float, Sequence[float]] | None


def log_named(name: str, argument: str, logs: Sequence[str]) -> str:
    """The log whose file name, with or without extension, is ``name``; errors name ``argument``.

    Raises:
        ArgumentError: no log or several logs have this name.
    """
    fitting = [log for log in logs if name == log] or [
        log for log in logs if name == Path(log).stem
    ]
    if len(fitting) != 1:
        there = f"two are called {name!r}" if fitting else f"no log {name!r}"
        text = f"{argument}: {there}; expected one of {', '.join(logs)}"
        raise ArgumentError(cause("log-name", text, name))
    return fitting[0]


def load_of(value: LoadLike, log: str = "") -> Load | None:
    """The load that a value stands for; ``log`` names the log in an error.

    Raises:
        ArgumentError: neither kg nor (kg, (x, y, z)), a negative mass, or above ``Load.heaviest``.
    """
    if value is None or isinstance(value, Load):
        return value
    said = f'`payload={{"{log}": {_python(value)}}}`' if log else f"`payload={_python(value)}`"
    try:
        pair: Any = value if isinstance(value, tuple | list) else (value, None)
        mass, centre = float(pair[0]), None if pair[1] is None else tuple(map(float, pair[1]))
    except (TypeError, ValueError, IndexError):
        text = f"{said}: expected kg, or (kg, (x, y, z)), or None for an unknown load"
        raise ArgumentError(cause("payload", text)) from None
    if mass > Load.heaviest:
        text = f"{said}: {mass:g} kg, expected at most {Load.heaviest:g}; loads are given in kg"
        raise ArgumentError(cause("payload", text))
    return Load(mass, centre)  # type: ignore[arg-type]


def loads_of(payload: Mapping[str, LoadLike], logs: Sequence[str]) -> dict[str, Load | None]:
    """The load of each log; logs that ``payload`` does not name have none.

    Raises:
        ArgumentError: a name of no log, or as for :func:`load_of`.
    """
    loads: dict[str, Load | None] = dict.fromkeys(logs, Load())
    for name, value in payload.items():
        log = log_named(name, f'`payload={{"{name}": {_python(value)}}}`', logs)
        loads[log] = load_of(value, name)
    return loads


def _python(value: Any) -> str:
    """A load as Python, with short numbers."""
    if isinstance(value, tuple | list):
        return f"({', '.join(map(_python, value))})"
    return f"{value:g}" if isinstance(value, int | float) else repr(value)
