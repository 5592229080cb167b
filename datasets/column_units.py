"""Units of a log's columns, by their names, else by their values.

A unit in a column's name decides: "timestamp_us", "angle (deg)". Without one, the values decide:
angles beyond two turns at two joints are degrees, currents above 100 are mA, and times with sample
intervals of more than 0.5 are in milliseconds or a smaller unit.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from tauguard.arrays import Array
from tauguard.datasets.log_checks import AMPERES, FURTHEST
from tauguard.detectors.faults.inputs import FASTEST
from tauguard.findings import LogError

#: Units of a time column: smallest median step in the unit, and the unit [s].
CLOCKS = ((5e4, 1e-9), (50.0, 1e-6), (0.5, 1e-3), (0.0, 1.0))
#: A unit in brackets: "time [ms]", "angle (rad)".
UNIT = re.compile(r"[ _]*[\[(](?:\D|\^-?\d)*[\])]$")
#: Units in names, in the form that :func:`unit_of` compares, and their value in s, A or N m.
SECONDS = {
    **dict.fromkeys(("nanoseconds", "nanosecond", "nanosec", "nsec", "ns"), 1e-9),
    **dict.fromkeys(("microseconds", "microsecond", "usec", "us"), 1e-6),
    **dict.fromkeys(("milliseconds", "millisecond", "millis", "msec", "ms"), 1e-3),
    **dict.fromkeys(("seconds", "second", "secs", "sec", "s"), 1.0),
}
#: Units of the time column. At the end of other columns' names, "min" and "h" are no units.
TIME_UNITS = {
    **SECONDS,
    **dict.fromkeys(("minutes", "minute", "mins", "min"), 60.0),
    **dict.fromkeys(("hours", "hour", "hrs", "hr", "h"), 3600.0),
}
AMPERE_UNITS = {
    **dict.fromkeys(("milliamperes", "milliampere", "milliamps", "milliamp", "ma"), 1e-3),
    **dict.fromkeys(("amperes", "ampere", "amps", "amp", "a"), 1.0),
}
_NEWTON_METRES = {
    **dict.fromkeys(("mnm", "mn_m"), 1e-3),
    **dict.fromkeys(("ncm", "n_cm"), 1e-2),
    **dict.fromkeys(("nm", "n_m"), 1.0),
    **{f"newton{a}met{b}": 1.0 for a in ("_", "") for b in ("re", "res", "er", "ers")},
}
#: Units of angles and of angular speeds that a column map supports, and whether they are degrees.
_PER_SECOND = ("", *(a + b for a in ("_", "_per_") for b in ("s", "sec", "second")))
_ANGLES = {
    unit + per: unit.startswith("deg")
    for unit in ("degrees", "degree", "deg", "radians", "radian", "rad")
    for per in _PER_SECOND
}
_OTHER_ANGLES = ("rpm", *(u + per for u in ("mrad", "turns", "rev") for per in _PER_SECOND))
#: A unit as the last words of a name: "timestamp_us", "axis1_vel_deg_s".
_NAMES = "|".join((*SECONDS, *AMPERE_UNITS, *_NEWTON_METRES, *_ANGLES, *_OTHER_ANGLES))
WRITTEN = re.compile(f"(?<=[a-z0-9])_({_NAMES})$")
TIME_WRITTEN = re.compile(f"(?<=[a-z0-9])_({'|'.join(TIME_UNITS)})$")
#: Units in brackets that no column map supports, and units of another kind of signal.
_FOREIGN = re.compile(
    f"(?:^|_)(?:{'|'.join(name for name in _NAMES.split('|') if len(name) > 1)}|"
    r"(?:[kmcd]?n|k?gf?)_?[cmd]?m|kgf?|kn|kp|(?:lbf?|ozf?|ft|in)_?(?:ft|in|lbf?|ozf?)?|"
    r"(?:pound|ounce|volt|watt|joule|newton|count|tick|step|turn|pulse|increment|bit|hour|grad|"
    r"gradian|minute|cycle|rev|revolution)s?|feet|inch(?:es)?|hz|hertz|rps|gon|arc\w*|percent|permille|pct|"
    r"(?:kilo|centi|deci|milli|micro)\w*)(?:_|$)"
)
_SYMBOL = 3  #: length of the longest word in brackets that is taken for the symbol of a unit
#: Words of at most this length in brackets that are no units.
_SHORT_WORDS = {
    "act", "est", "arm", "abs", "avg", "raw", "rms", "iq", "dc", "utc", "gmt", "ros", "cpu",
}  # fmt: skip


def time_scale_of(name: str, t: Array) -> float:
    """Seconds in one unit of the time column, by its name, else by its usual step."""
    steps = np.diff(np.unique(t[np.isfinite(t)]))  # of the sorted times
    usual = float(np.median(steps)) if len(steps) else 0.0
    return unit_of(name, TIME_UNITS) or next(scale for least, scale in CLOCKS if usual >= least)


def units_of(
    groups: Mapping[str, Sequence[str]],
    numbers: Callable[[Sequence[str]], Array],
    given: bool | None = None,
) -> tuple[bool, float, float]:
    """Whether angles are degrees, and the units of currents [A] and of torques [N m].

    Args:
        groups: columns by signal.
        numbers: the values of some columns.
        given: the user's statement whether angles are degrees; None: not stated.

    Raises:
        LogError: columns in different or unknown units, or angles neither in radians nor in
            degrees, or angles that may be either.
    """
    angles = [*groups["q"], *groups.get("qd", ())]
    kinds = {"current": AMPERE_UNITS, "torque": _NEWTON_METRES}
    for field, names in groups.items():
        refuse_unknown(names, kinds.get(field, {**_ANGLES, **dict.fromkeys(_OTHER_ANGLES)}))
    for name in angles:
        if unit_of(name, dict.fromkeys(_OTHER_ANGLES, True)):
            raise LogError(
                f"column {name}: expected radians or degrees, per second for a speed: convert it, "
                "or give a column map without qd if only the velocities differ"
            )
    degrees = _one(
        {name: unit_of(name, _ANGLES) for name in angles},
        "convert one of them in the file, or give a column map without qd if only the velocities "
        "differ: positions are then differentiated",
    )
    amperes = _one(
        {name: unit_of(name, AMPERE_UNITS) for name in groups.get("current", ())},
        "give a column map with a current_scale for each joint",
    )
    newton_metres = _one(
        {name: unit_of(name, _NEWTON_METRES) for name in groups.get("torque", ())},
        "give a column map with a torque_scale for each joint",
    )

    if degrees is None:
        degrees = given
    if degrees is None:
        q, qd = numbers(groups["q"]), numbers(groups.get("qd", ()))
        degrees = "deg" in groups["q"][0].lower() or _in_degrees(groups["q"], q, qd)
    if amperes is None:
        currents = np.abs(numbers(groups.get("current", ())))
        amperes = 1e-3 if (currents > AMPERES).any() else 1.0  # a cell without a number is NaN
    return degrees, amperes, newton_metres or 1.0


def _in_degrees(names: Sequence[str], q: Array, qd: Array) -> bool:
    """Whether angles, (rows, n), are degrees, by their values and by speeds, if the log has any.

    The last joint of some arms turns by more than two turns, so one joint alone is no proof. Such
    angles are radians if half of the joints are faster than 1 and none is faster than ``FASTEST``.

    Raises:
        LogError: one joint is beyond two turns, and the speeds do not decide.
    """
    far = (np.abs(q) > FURTHEST).any(axis=0)
    if far.sum() != 1:
        return bool(far.any())
    speeds = np.abs(qd)
    if (speeds > FASTEST).any():
        return True
    if qd.shape[1] and 2 * (speeds > 1.0).any(axis=0).sum() >= q.shape[1]:
        return False
    joint = int(np.argmax(far))
    raise LogError(
        f"column {names[joint]} is beyond two turns ({np.nanmax(np.abs(q[:, joint])):.4g}) as the "
        'only position: if angles are in degrees, say `mend="deg"` or `mend="rad"` if in radians'
    )


def refuse_unknown(names: Sequence[str], units: Mapping[str, Any]) -> None:
    """Raise ``LogError`` for a unit in brackets that is none of ``units``.

    Words that are no unit, and words that differ from joint to joint, are part of the name.
    """
    known = re.compile(f"(?:^|_)(?:{'|'.join(units)})$")
    told = {name: re.findall(r"[^\[\]()]+", "".join(UNIT.findall(name))) for name in names}
    rest = {
        name: [known.sub("", words_of(text.replace("/", " per "))) for text in told[name]]
        for name in names
    }
    differ = len(set(map(str, rest.values()))) > 1 and all(map(any, rest.values()))
    for name in names:
        for text, words in zip(told[name], rest[name], strict=True):
            odd = (words or not words_of(text)) and re.search(r"[/^%\d]", text)
            short = all(len(w) <= _SYMBOL and w not in _SHORT_WORDS for w in words.split("_"))
            if odd or _FOREIGN.search(words) or (words and short and not differ):
                short_forms = [u for u in units if len(u) < 6 and units[u] is not None]
                raise LogError(
                    f"column {name}: unit {text} is not known, expected one of "
                    f"{', '.join(short_forms).replace('_', ' ')}; convert it, or give a column map "
                    "with the scale"
                )


def _one(said: Mapping[str, Any], remedy: str) -> Any:
    """The unit that the names of some columns give, None if no name has one."""
    named = {name: value for name, value in said.items() if value is not None}
    first = next(iter(named), "")
    for name, value in named.items():
        if value != named[first]:
            raise LogError(
                f"columns {first} and {name} are in different units, but auto needs the same for "
                f"both: {remedy}"
            )
    return named.get(first)


def words_of(name: str) -> str:
    """A name in plain letters, with one underscore between its words."""
    told = name.lower().replace("°", "deg").replace("\u00b5", "u").replace("\u03bc", "u")
    return re.sub(r"[^a-z0-9]+", "_", told).strip("_")


def unit_of(name: str, units: Mapping[str, Any]) -> Any:
    """Value in ``units`` of the unit at the end of a name (before a joint's number); None: none."""
    words = re.sub(r"_?\d+$", "", words_of(name))
    return next((said for unit, said in units.items() if f"_{words}".endswith(f"_{unit}")), None)
