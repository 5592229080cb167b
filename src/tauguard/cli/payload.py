"""The flag --payload of commands: loads that the arm carried."""

from __future__ import annotations

from collections.abc import Sequence

from tauguard.findings import ArgumentError

#: A load as the argument ``payload`` of the library: kg, or kg and centre [m]; None: unknown.
Value = float | tuple[float, tuple[float, ...]] | None


def loads(texts: Sequence[str]) -> dict[str, Value]:
    """The loads in ``--payload LOG=KG``, ``LOG=KG,X,Y,Z`` or ``LOG=unknown``, by log.

    Raises:
        ArgumentError: a text of another form.
    """
    form = "LOG=KG, LOG=KG,X,Y,Z or LOG=unknown"
    parts = [(text, *text.rpartition("=")[::2]) for text in texts]
    return {
        log: None if value == "unknown" else _load(text, value, form) for text, log, value in parts
    }


def load(text: str) -> Value:
    """The load in ``--payload KG`` or ``--payload KG,X,Y,Z``.

    Raises:
        ArgumentError: the text has another form.
    """
    if text == "unknown":
        raise ArgumentError("--payload unknown: for an unknown load, do not give this flag")
    return _load(text, text, "KG or KG,X,Y,Z, 0 for nothing")


def _load(text: str, value: str, form: str) -> Value:
    try:
        numbers = [float(number) for number in value.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (1, 4):
        raise ArgumentError(f"--payload {text}: expected {form}")
    return numbers[0] if len(numbers) == 1 else (numbers[0], tuple(numbers[1:]))
