"""The keys of a dataset's description: type, range, default, and errors that name them."""

import difflib
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Any, NoReturn

from tauguard.datasets.plans import CLAMP_SECONDS, OFFSET, SLOT, SPREAD
from tauguard.findings import FileError
from tauguard.models import Mismatch, cura6
from tauguard.traces import KINDS, STRATA

REQUIRED = object()
Read = Callable[[Any], Any]


@dataclass(frozen=True)
class Key:
    """The values that a key accepts."""

    read: Read  #: converts the value; ``FileError`` if out of range
    expected: str  #: accepted values, for messages and documentation
    default: Any = REQUIRED


def refuse(key: str, value: Any, expected: str) -> NoReturn:
    """Raise ``FileError`` with the key, its value and the expected values."""
    shown = repr(value)
    shown = shown if len(shown) <= 60 else f"{shown[:57]}..."
    raise FileError(f"{key} = {shown}: expected {expected}")


def closest(word: str, known: Iterable[str]) -> str:
    """A hint that names the most similar known word; empty if none is similar."""
    near = difflib.get_close_matches(word, list(known), n=1)
    return f" (did you mean {near[0]}?)" if near else ""


def checked_table(
    where: str, values: Mapping[str, Any], keys: Mapping[str, Key], partial: bool = False
) -> dict[str, Any]:
    """Read and check all keys of a table; missing keys get their defaults.

    Args:
        where: the table's name.
        values: the table's content.
        keys: known keys.
        partial: required keys may be missing.

    Raises:
        FileError: an unknown or missing key, or a value out of range.
    """
    dot = f"{where}." if where else ""
    for name in values:
        if name not in keys:
            raise FileError(
                f"{dot}{name}: unknown key{closest(name, keys)}; expected one of {', '.join(keys)}"
            )
    found = {}
    for name, key in keys.items():
        if name in values:
            try:
                found[name] = key.read(values[name])
            except (ValueError, TypeError):
                refuse(f"{dot}{name}", values[name], key.expected)
        elif key.default is not REQUIRED:
            found[name] = key.default
        elif not partial:
            raise FileError(f"{dot}{name}: missing; expected {key.expected}")
    return found


def number(low: float, high: float, above: bool = False) -> Read:
    """Reader of a number in [low, high], or (low, high] with ``above``."""

    def read(value: Any) -> float:
        checked = float(of_type(int, float)(value))
        if not low <= checked <= high or (above and checked == low):
            raise FileError
        return checked

    return read


def integer(low: int, high: int) -> Read:
    """Reader of a whole number in [low, high]."""

    def read(value: Any) -> int:
        if not low <= of_type(int)(value) <= high:
            raise FileError
        return int(value)

    return read


def of_type(*kinds: type) -> Read:
    """Reader of a value of one of ``kinds``; true and false are no numbers."""

    def read(value: Any) -> Any:
        if type(value) not in kinds:
            raise FileError
        return value

    return read


def matching(pattern: str) -> Read:
    """Reader of a text that a regular expression matches as a whole."""

    def read(value: Any) -> str:
        if not re.fullmatch(pattern, value):
            raise FileError
        return str(value)

    return read


def several(read: Read, least: int = 1, distinct: bool = False) -> Read:
    """Reader of a list of at least ``least`` values."""

    def read_all(value: Any) -> tuple[Any, ...]:
        items = tuple(read(item) for item in of_type(list, tuple)(value))
        if len(items) < least or (distinct and len(set(items)) < len(items)):
            raise FileError
        return items

    return read_all


def span(low: float, high: float, equal: bool) -> Read:
    """Reader of two increasing numbers in [low, high]; with ``equal`` they may be equal."""
    inner = number(low, high)

    def read(value: Any) -> tuple[float, float]:
        a, b = (inner(v) for v in value)
        if not (a < b or (equal and a == b)):
            raise FileError
        return a, b

    return read


def rows_a_second(value: Any) -> int:
    """Read a sample rate that divides the 1000 Hz of the physics."""
    rate = int(integer(1, 1000)(value))
    if 1000 % rate:
        raise FileError
    return rate


_LARGEST = {f.name: 0.09 if f.name == "com" else 0.5 for f in fields(Mismatch) if f.name != "seed"}
_DEFAULT = Mismatch(seed=0)
#: Longest clamp [s]: it ends at least 0.5 s before the end of its slot.
LONGEST_CLAMP = round(SLOT - OFFSET - SPREAD - 0.5, 6)
SPLIT = {
    "name": Key(matching("[A-Za-z0-9][A-Za-z0-9_-]{0,39}"), "letters, digits, - and _, at most 40"),
    "episodes": Key(integer(1, 10_000_000), "a whole number, 1 to 10,000,000"),
    "quick_episodes": Key(integer(1, 10_000_000), "a whole number from 1", None),
    "seconds": Key(number(1, 600), "seconds, 1 to 600", 60.0),
    "arms": Key(
        several(of_type(str), distinct=True),
        f"a list of {', '.join(cura6.NAMES)}, names of `tauguard robot` or robot files",
    ),
    "individuals": Key(
        several(integer(-1, 2**31), distinct=True), "a list of different seeds, -1 for no mismatch"
    ),
    "speeds": Key(several(number(1, 100, above=True)), "a list of percentages above 1 to 100"),
    "payloads_g": Key(several(number(0, 20_000)), "a list of grams, 0 to 20,000", (0.0,)),
    "struck": Key(number(0, 1), "a fraction, 0 to 1", 0.5),
    "collisions": Key(integer(1, 200), "a whole number, 1 to 200", None),
    "kinds": Key(
        several(matching("|".join(KINDS))),
        f"a list of {', '.join(KINDS)}",
        ("strike", "pulse", "strike", "clamp"),
    ),
    "links": Key(several(integer(1, 40)), "a list of links, counted from 1", None),
    "severities": Key(
        several(span(0.1, 500, equal=False)), "a list of [low, high] in N m, 0.1 to 500", STRATA
    ),
    "temperature": Key(span(-10, 80, equal=True), "[low, high] in degC, -10 to 80", (25.0, 45.0)),
    "picks": Key(number(0, 1), "a fraction, 0 to 1", 0.0),
    "unseen": Key(
        several(matching("arm|individual|payload|speed"), least=0, distinct=True),
        "a list of arm, individual, payload, speed",
        (),
    ),
    "clamp_seconds": Key(
        span(0.05, LONGEST_CLAMP, equal=True),
        f"[low, high] in seconds, 0.05 to {LONGEST_CLAMP:g}",
        CLAMP_SECONDS,
    ),
    "paired": Key(of_type(bool), "true or false", False),
}
KEYS: dict[str, dict[str, Key]] = {
    "top": {
        "name": Key(
            matching("[a-z0-9][a-z0-9._-]{0,63}"),
            "small letters, digits, dots and dashes, at most 64",
        ),
        "seed": Key(integer(0, 2**62), "a whole number, 0 to 2^62"),
        "rate": Key(rows_a_second, "rows per second that divide 1000", 1000),
        "episodes_per_shard": Key(integer(1, 1000), "a whole number, 1 to 1000", 10),
        "residual": Key(of_type(bool), "true or false", False),
        "objects": Key(of_type(str), "a TOML file that lists objects around the arm", ""),
    },
    "mismatch": {
        name: Key(number(0, largest), f"a half-width, 0 to {largest}", getattr(_DEFAULT, name))
        for name, largest in _LARGEST.items()
    },
    "split": SPLIT,
}
