"""Propose a column map for a CSV file from the names and values of its columns.

A group of columns has names that differ by a joint's number, such as ``q0`` to ``q6``,
``actual_q_0`` or ``/joint_states/position[0]``. The last word of the name tells the signal.
Commanded values are ignored. A unit in a name is used: "timestamp_us", "angle (deg)". Else, values
decide: angles beyond two turns are degrees, currents above 100 are mA, and times with sample
intervals of more than 0.5 are in milliseconds or a smaller unit.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tauguard.arrays import Array
from tauguard.datasets.columns import ColumnMap
from tauguard.datasets.log_checks import AMPERES, FURTHEST

#: Last words of a group's name, by the field of the map.
WORDS = {
    "q": ("q", "position", "positions", "pos", "angle", "joint_position", "joint_positions"),
    "qd": ("qd", "dq", "velocity", "velocities", "vel", "speed", "qdot", "joint_velocity"),
    "torque": ("tau_j", "tau", "torque", "torques", "effort", "efforts", "joint_torque"),
    "current": ("i", "current", "currents", "amps", "joint_current", "actual_current"),
}
TIMES = ("t", "time", "timestamp", "time_stamp", "stamp", "seconds", "sec", "duration", "__time")
#: Unit of a time column by its usual step: smallest step of each unit, and the unit [s].
CLOCKS = ((5e4, 1e-9), (50.0, 1e-6), (0.5, 1e-3), (0.0, 1.0))
#: Words in names of commands and estimates; ``_OTHER``: also of other signals that are not measured
#: at the joints.
_COMMANDS = "target|desired|des|command|commanded|cmd|goal|ref|reference|ext|external"
_OTHER = re.compile(
    f"(^|_)({_COMMANDS}|control|gravity|coriolis|tcp|flange|tool|cartesian|raw|ipo)(_|$)"
)
#: Columns of ROS's JointState in a table: the joint's name, then the kind of signal.
_NAMED = re.compile(
    r"^(.*?)(?:([^/.]+)[/.]|(\w+_joint)[_ ])(position|velocity|effort|current|torque)$"
)
#: Name of the torques of KUKA's FRI, which have the opposite sign.
_FRI = "measured_torque"
_NUMBER = re.compile(r"^(.*?)[\[_.(/ ]*?(\d{1,2})[\])]?$")
#: A joint's number, followed by the kind of signal: "joint_1_position", "J1 angle (rad)".
_WITHIN = re.compile(r"^(.*?)(\d{1,2})[\])]?[ _./]+([A-Za-z][A-Za-z_ ]*)$")
#: A unit in brackets: "time [ms]", "angle (rad)".
_UNIT = re.compile(r"[ _]*[\[(](?:\D|\^-?\d)*[\])]$")
#: Units in names, in the form that :func:`_unit` compares, and their value in s, A or N m.
_SECONDS = {
    **dict.fromkeys(("nanoseconds", "nanosecond", "nanosec", "nsec", "ns"), 1e-9),
    **dict.fromkeys(("microseconds", "microsecond", "usec", "us"), 1e-6),
    **dict.fromkeys(("milliseconds", "millisecond", "millis", "msec", "ms"), 1e-3),
    **dict.fromkeys(("seconds", "second", "secs", "sec", "s"), 1.0),
}
#: Units of the time column, which may end its name as well; of other columns, "min" is no unit.
_TIME_UNITS = {
    **_SECONDS,
    **dict.fromkeys(("minutes", "minute", "mins", "min"), 60.0),
    **dict.fromkeys(("hours", "hour", "hrs", "hr", "h"), 3600.0),
}
_AMPERES = {
    **dict.fromkeys(("milliamperes", "milliampere", "milliamps", "milliamp", "ma"), 1e-3),
    **dict.fromkeys(("amperes", "ampere", "amps", "amp", "a"), 1.0),
}
_NEWTON_METRES = {
    **dict.fromkeys(("mnm", "mn_m"), 1e-3),
    **dict.fromkeys(("ncm", "n_cm"), 1e-2),
    **dict.fromkeys(("nm", "n_m"), 1.0),
    **{f"newton{a}met{b}": 1.0 for a in ("_", "") for b in ("re", "res", "er", "ers")},
}
#: Units of angles and of angular speeds that a map can hold, and whether they are degrees.
_PER_SECOND = ("", *(a + b for a in ("_", "_per_") for b in ("s", "sec", "second")))
_ANGLES = {
    unit + per: unit.startswith("deg")
    for unit in ("degrees", "degree", "deg", "radians", "radian", "rad")
    for per in _PER_SECOND
}
_OTHER_ANGLES = ("rpm", *(u + per for u in ("mrad", "turns", "rev") for per in _PER_SECOND))
#: A unit as the last words of a name: "timestamp_us", "axis1_vel_deg_s".
_NAMES = "|".join((*_SECONDS, *_AMPERES, *_NEWTON_METRES, *_ANGLES, *_OTHER_ANGLES))
_WRITTEN = re.compile(f"(?<=[a-z0-9])_({_NAMES})$")
_TIME_WRITTEN = re.compile(f"(?<=[a-z0-9])_({'|'.join(_TIME_UNITS)})$")
#: Units in brackets that no map can hold, and units of another kind of signal.
_FOREIGN = re.compile(
    f"(?:^|_)(?:{'|'.join(name for name in _NAMES.split('|') if len(name) > 1)}|"
    r"(?:[kmcd]?n|k?gf?)_?[cmd]?m|kgf?|kn|kp|(?:lbf?|ozf?|ft|in)_?(?:ft|in|lbf?|ozf?)?|"
    r"(?:pound|ounce|volt|watt|joule|newton|count|tick|step|turn|pulse|increment|bit|hour|grad|"
    r"gradian|minute|cycle|rev|revolution)s?|feet|inch(?:es)?|hz|hertz|rps|gon|arc\w*|percent|permille|pct|"
    r"(?:kilo|centi|deci|milli|micro)\w*)(?:_|$)"
)
#: Longest word in brackets that is taken for the symbol of a unit, and words that are none.
_SYMBOL = 3
_SHORT_WORDS = {
    "act",
    "est",
    "arm",
    "abs",
    "avg",
    "raw",
    "rms",
    "iq",
    "dc",
    "utc",
    "gmt",
    "ros",
    "cpu",
}
#: Smallest and largest number of joints of an arm.
FEWEST, MOST = 2, 16


def grouped(header: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Columns whose names differ only in a last, consecutive number, grouped by name."""
    found: dict[str, list[tuple[int, str]]] = {}
    named: dict[str, list[str]] = {}
    for name in header:
        plain = _UNIT.sub("", name)
        if re.search(f"(^|_)({_COMMANDS})(_|$)", _words(name[len(plain) :])):
            continue
        if match := _NAMED.match(plain):
            named.setdefault(match.group(1) + match.group(4), []).append(name)
        elif match := _WITHIN.match(plain):
            prefix = f"{match.group(1)}_{match.group(3)}"
            found.setdefault(prefix, []).append((int(match.group(2)), name))
        elif match := _NUMBER.match(plain):
            found.setdefault(match.group(1), []).append((int(match.group(2)), name))
    out = {}
    for prefix, columns in found.items():
        columns.sort()
        first = columns[0][0]
        if [n for n, _ in columns] == list(range(first, first + len(columns))):
            out[prefix] = tuple(name for _, name in columns)
    return out | {prefix: tuple(columns) for prefix, columns in named.items()}


def _field(prefix: str) -> str | None:
    whole = re.sub(r"[^a-z0-9]+", "_", prefix.lower()).strip("_")
    if _OTHER.search(whole):
        return None
    for plain in (_WRITTEN.sub("", whole), whole):  # "amps" is a unit and a signal
        for field, words in WORDS.items():
            if plain in words or any(
                plain.endswith("_" + word) for word in words if len(word) > 1 or word == "q"
            ):
                return field
    return None


def recognised(header: Sequence[str], table: Array) -> ColumnMap | None:
    """The map that names and values suggest; None if positions, efforts or a clock are not found.

    Args:
        header: names of all columns.
        table: values of some rows, NaN for a cell that is no number, shape (rows, columns).

    Raises:
        ValueError: columns of one kind in different units, or a time in two columns.
    """

    def plain(name: str) -> str:
        return _TIME_WRITTEN.sub("", _UNIT.sub("", name).strip(" #").lower())

    times = [name for name in header if plain(name) in TIMES]
    time = next(iter(times), None)
    groups: dict[str, tuple[str, ...]] = {}
    for prefix, columns in grouped(header).items():
        field = _field(prefix)
        if field and FEWEST <= len(columns) <= MOST and field not in groups:
            groups[field] = columns
    effort = next((f for f in ("torque", "current") if f in groups), None)
    if "q" not in groups or effort is None:
        return None
    joints = len(groups["q"])
    if len(groups[effort]) != joints or len(groups.get("qd", groups["q"])) != joints:
        return None

    def numbers(columns: Sequence[str]) -> Array:
        return table[:, [list(header).index(name) for name in columns]]

    repair = {"repeat", "tail", "state"}
    used = {field: columns for field, columns in groups.items() if field in ("q", "qd", effort)}
    degrees, amperes, newton_metres = _units(used, numbers)
    scale, clock = 1.0, 0.0
    if time is not None:
        _refuse_unknown([time], _TIME_UNITS)
        for name in times:
            _refuse_parts(name, numbers([name])[:, 0], header)
        t = numbers([time])[:, 0]
        steps = np.diff(t[np.isfinite(t)])
        repair |= {"order"} if (steps < 0).any() else set()
        scale = _time_scale(time, t)
    elif "qd" not in groups or not (clock := rate_of(numbers(groups["q"]), numbers(groups["qd"]))):
        return None
    return ColumnMap(
        t=time,
        q=groups["q"],
        qd=groups.get("qd", ()),
        current=groups["current"] if effort == "current" else (),
        torque=groups["torque"] if effort == "torque" else (),
        degrees=degrees,
        time_scale=scale,
        clock=clock,
        current_scale=amperes,
        torque_scale=-newton_metres if _FRI in groups[effort][0] else newton_metres,
        joint_names=_joints(groups["q"]),
        repair=frozenset(repair),
    )


def _refuse_parts(time: str, t: Array, header: Sequence[str]) -> None:
    """Raise ``ValueError`` if the time has whole seconds, and another column their fractions."""
    rest = [name for name in header if (_unit(name, _SECONDS) or 1.0) < 1e-3 and name != time]
    known = t[np.isfinite(t)]
    if rest and (known == np.floor(known)).all() and (np.diff(known) == 0).any():
        raise ValueError(
            f"columns {time} and {rest[0]}: parts of one time, but auto reads one column; write "
            "their sum into one column of the file"
        )


def _time_scale(name: str, t: Array) -> float:
    """Seconds in one unit of the time column, by its name, else by its usual step."""
    steps = np.diff(np.unique(t[np.isfinite(t)]))  # of the sorted times
    usual = float(np.median(steps)) if len(steps) else 0.0
    return _unit(name, _TIME_UNITS) or next(scale for least, scale in CLOCKS if usual >= least)


def _units(
    groups: Mapping[str, Sequence[str]], numbers: Callable[[Sequence[str]], Array]
) -> tuple[bool, float, float]:
    """Units by names, else by values: whether angles are degrees, unit of currents, of torques.

    Raises:
        ValueError: columns in different or unknown units, or angles neither in radians nor in
            degrees.
    """
    angles = [*groups["q"], *groups.get("qd", ())]
    kinds = {"current": _AMPERES, "torque": _NEWTON_METRES}
    for field, names in groups.items():
        _refuse_unknown(names, kinds.get(field, {**_ANGLES, **dict.fromkeys(_OTHER_ANGLES)}))
    for name in angles:
        if _unit(name, dict.fromkeys(_OTHER_ANGLES, True)):
            raise ValueError(
                f"column {name}: expected radians or degrees, per second for a speed: convert it, "
                "or give a column map without qd if only the velocities differ"
            )
    degrees = _one(
        {name: _unit(name, _ANGLES) for name in angles},
        "convert one of them in the file, or give a column map without qd if only the velocities "
        "differ: positions are then differentiated",
    )
    amperes = _one(
        {name: _unit(name, _AMPERES) for name in groups.get("current", ())},
        "give a column map with a current_scale for each joint",
    )
    newton_metres = _one(
        {name: _unit(name, _NEWTON_METRES) for name in groups.get("torque", ())},
        "give a column map with a torque_scale for each joint",
    )

    def beyond(field: str, limit: float) -> bool:
        values = np.abs(numbers(groups.get(field, ())))
        return bool((values[np.isfinite(values)] > limit).any())

    if degrees is None:
        degrees = beyond("q", FURTHEST) or "deg" in groups["q"][0].lower()
    if amperes is None:
        amperes = 1e-3 if beyond("current", AMPERES) else 1.0
    return degrees, amperes, newton_metres or 1.0


def _refuse_unknown(names: Sequence[str], units: Mapping[str, Any]) -> None:
    """Raise ``ValueError`` for a unit in brackets that is none of ``units``.

    Words that are no unit, and words that differ from joint to joint, are part of the name.
    """
    known = re.compile(f"(?:^|_)(?:{'|'.join(units)})$")
    told = {name: re.findall(r"[^\[\]()]+", "".join(_UNIT.findall(name))) for name in names}
    rest = {
        name: [known.sub("", _words(text.replace("/", " per "))) for text in told[name]]
        for name in names
    }
    differ = len(set(map(str, rest.values()))) > 1 and all(map(any, rest.values()))
    for name in names:
        for text, words in zip(told[name], rest[name], strict=True):
            odd = (words or not _words(text)) and re.search(r"[/^%\d]", text)
            short = all(len(w) <= _SYMBOL and w not in _SHORT_WORDS for w in words.split("_"))
            if odd or _FOREIGN.search(words) or (words and short and not differ):
                short_forms = [u for u in units if len(u) < 6 and units[u] is not None]
                raise ValueError(
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
            raise ValueError(
                f"columns {first} and {name} are in different units, but auto needs the same for "
                f"both: {remedy}"
            )
    return named.get(first)


def _words(name: str) -> str:
    """A name in plain letters, with one underscore between its words."""
    told = name.lower().replace("°", "deg").replace("\u00b5", "u").replace("\u03bc", "u")
    return re.sub(r"[^a-z0-9]+", "_", told).strip("_")


def _unit(name: str, units: Mapping[str, Any]) -> Any:
    """Value in ``units`` of the unit at the end of a name (before a joint's number); None: none."""
    words = re.sub(r"_?\d+$", "", _words(name))
    return next((said for unit, said in units.items() if f"_{words}".endswith(f"_{unit}")), None)


def in_units_of(preset: ColumnMap, found: ColumnMap) -> ColumnMap:
    """The preset in the recognised units: degrees, milliseconds, milliamperes."""
    milli = bool(preset.current) and found.current_scale != 1.0
    return replace(
        preset,
        degrees=preset.degrees or found.degrees,
        time_scale=found.time_scale if preset.time_scale == 1.0 else preset.time_scale,
        current_scale=found.current_scale if milli else preset.current_scale,
        repair=preset.repair | found.repair,
    )


def _joints(columns: Sequence[str]) -> tuple[str, ...]:
    """Joint names, if the names of all columns contain them."""
    found = [m.group(2) or m.group(3) for n in columns if (m := _NAMED.match(_UNIT.sub("", n)))]
    return tuple(found) if len(found) == len(columns) else ()


def rate_of(q: Array, qd: Array) -> float:
    """Sample rate at which the velocities fit the positions [Hz]; 0 if nothing moves.

    Args:
        q: shape (rows, n).
        qd: in the same unit per second, shape (rows, n).
    """
    change, speed = np.diff(q, axis=0), (qd[1:] + qd[:-1]) / 2
    good = np.isfinite(change) & np.isfinite(speed)
    both = float((change * speed)[good].sum())
    rate = float((speed**2)[good].sum()) / both if both > 0 else 0.0
    return round(rate, 1) if 1.0 < rate < 1e4 else 0.0


def described(columns: ColumnMap) -> str:
    """A map in one line, for the user to accept."""
    unit = {1e-9: "ns", 1e-6: "us", 1e-3: "ms", 1.0: "s", 60.0: "min", 3600.0: "h"}
    angle = "deg" if columns.degrees else "rad"
    ampere = "mA" if columns.current_scale == 1e-3 else "A"
    time = f"time {columns.t} [{unit[columns.time_scale]}]"
    if columns.t is None:
        time = f"no time, {columns.clock:g} rows per second by the velocities"
    scale = columns.torque_scale
    assert isinstance(scale, float)  # `recognised` makes no scale per joint
    torque = {1.0: "N m", 1e-2: "N cm", 1e-3: "mN m"}[abs(scale)]
    torque += ", opposite sign" if scale < 0 else ""
    parts = [time, f"positions {_span(columns.q)} [{angle}]"]
    parts.append(f"velocities {_span(columns.qd)} [{angle}/s]" if columns.qd else "no velocities")
    parts.append(
        f"joint torques {_span(columns.torque)} [{torque}]"
        if columns.torque
        else f"currents {_span(columns.current)} [{ampere}]"
    )
    if "order" in columns.repair:
        parts.append("rows sorted by time")
    return ", ".join(parts)


def _span(names: Sequence[object]) -> str:
    return f"{names[0]} to {names[-1]}"
