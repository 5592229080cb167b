"""Propose a column map for a CSV file from the names and values of its columns.

A group of columns has names that differ by a joint's number, such as ``q0`` to ``q6``,
``actual_q_0`` or ``/joint_states/position[0]``. The last word of the name tells the signal.
Commanded values are ignored. Units: :mod:`tauguard.datasets.column_units`.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tauguard.arrays import Array
from tauguard.datasets.column_units import (
    AMPERE_UNITS,
    SECONDS,
    TIME_UNITS,
    TIME_WRITTEN,
    UNIT,
    WRITTEN,
    refuse_unknown,
    time_scale_of,
    unit_of,
    units_of,
    words_of,
)
from tauguard.datasets.columns import ColumnMap
from tauguard.findings import LogError

#: Last words of a group's name, by the field of the map.
WORDS = {
    "q": ("q", "position", "positions", "pos", "angle", "joint_position", "joint_positions"),
    "qd": ("qd", "dq", "velocity", "velocities", "vel", "speed", "qdot", "joint_velocity"),
    "torque": ("tau_j", "tau", "torque", "torques", "effort", "efforts", "joint_torque"),
    "current": ("i", "current", "currents", "cur", "amps", "joint_current", "actual_current"),
}
TIMES = ("t", "time", "timestamp", "time_stamp", "stamp", "seconds", "sec", "duration", "__time")
#: Words in names of commands and estimates.
_COMMANDS = "target|desired|des|command|commanded|cmd|goal|ref|reference|ext|external"
_COMMANDED = re.compile(f"(^|_)({_COMMANDS})(_|$)")
#: Words in names of signals that are not measured at the joints.
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
FEWEST, MOST = 2, 16  #: smallest and largest number of joints of an arm


def grouped(header: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Columns whose names differ only in a last, consecutive number, grouped by name."""
    found: dict[str, list[tuple[int, str]]] = {}
    named: dict[str, list[str]] = {}
    for name in header:
        plain = UNIT.sub("", name)
        if _COMMANDED.search(words_of(name[len(plain) :])):
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
    for plain in (WRITTEN.sub("", whole), whole):  # a unit alone may name a signal: "amps"
        for field, words in WORDS.items():
            if plain in words or any(
                plain.endswith("_" + word) for word in words if len(word) > 1 or word == "q"
            ):
                return field
    return None


def _parted(name: str) -> str:
    """Words of a name, with digits as words of their own: J1 and j_1 are the same."""
    return re.sub(r"(?<=[a-z])(?=\d)|(?<=\d)(?=[a-z])", "_", words_of(name))


def of_joints(header: Sequence[str], joints: Sequence[str]) -> dict[str, dict[str, str]]:
    """Columns by signal and joint, where names hold a joint's name as whole words.

    Args:
        header: names of all columns.
        joints: the robot's joints; if a name contains two of them, the longer one counts.
    """
    words = {joint: _parted(joint) for joint in joints if _parted(joint)}
    found: dict[str, dict[str, str]] = {}
    for name in header:
        plain = UNIT.sub("", name)
        if _COMMANDED.search(words_of(name[len(plain) :])):
            continue
        text = f"_{_parted(plain)}_"
        held = [joint for joint in words if f"_{words[joint]}_" in text]
        if held:
            joint = max(held, key=lambda one: len(words[one]))
            rest = text.replace(f"_{words[joint]}_", "_", 1).strip("_")
            found.setdefault(rest, {}).setdefault(joint, name)
    out: dict[str, dict[str, str]] = {}
    for rest, columns in found.items():
        field = _field(rest)
        if field is None and not _OTHER.search(rest):
            ampere = all(UNIT.search(c) and unit_of(c, AMPERE_UNITS) for c in columns.values())
            field = "current" if ampere else None
        if field and len(columns) >= FEWEST:
            out.setdefault(field, {j: columns[j] for j in joints if j in columns})
    return out


@dataclass(frozen=True)
class _Found:
    """Columns of each signal, before units are known."""

    times: list[str]
    groups: dict[str, tuple[str, ...]]  #: columns by signal
    joints: tuple[str, ...]  #: joints of the position columns, if the columns' names contain them
    lacks: str  #: what is missing for a map; empty: nothing

    @property
    def effort(self) -> str | None:
        """The signal of the torques."""
        return next((f for f in ("torque", "current") if f in self.groups), None)


#: Signals in plain words.
_PLAIN = {"q": "positions", "qd": "velocities", "torque": "torques", "current": "currents"}


def _found(header: Sequence[str], joints: Sequence[str]) -> _Found:
    def plain(name: str) -> str:
        return TIME_WRITTEN.sub("", UNIT.sub("", name).strip(" #").lower())

    times = [name for name in header if plain(name) in TIMES]
    named = of_joints(header, joints)
    groups = {field: tuple(columns.values()) for field, columns in named.items()}
    for prefix, columns in grouped(header).items():
        field = _field(prefix)
        if field and FEWEST <= len(columns) <= MOST and field not in groups:
            groups[field] = columns
    own = tuple(named.get("q", ()))
    lacks = [] if "q" in groups else ["positions"]
    lacks += [] if {"torque", "current"} & groups.keys() else ["currents or torques"]
    lacks += [] if times or "qd" in groups else ["time"]
    if "q" in groups and own == () and len(groups["q"]) < len(joints):
        others = [name for name in header if _sibling(name, groups["q"])]
        lacks += [f"the joints of {', '.join(others)}"] if others else []
    return _Found(times, groups, own or _joints(groups.get("q", ())), " and ".join(lacks))


def _sibling(name: str, columns: Sequence[str]) -> bool:
    """Whether a name without number begins or ends as the names of the numbered positions do."""
    words, same = words_of(UNIT.sub("", name)), words_of(UNIT.sub("", columns[0])).split("_")
    parts = words.split("_")
    alike = [w for w in (same[0], same[-1]) if w in WORDS["q"]]
    return name not in columns and not _OTHER.search(words) and any(w in parts for w in alike)


def lacking(header: Sequence[str], joints: Sequence[str] = ()) -> str:
    """What :func:`recognised` finds among columns, and what it misses, in one line."""
    found = _found(header, joints)
    told = [f"time: {found.times[0]}"] if found.times else []
    for field, columns in found.groups.items():
        told.append(f"{_PLAIN[field]}: {_span(columns)} ({len(columns)})")
    lacks = found.lacks
    for field, columns in found.groups.items() if not lacks else ():
        if len(columns) != len(found.groups["q"]):
            absent = [j for j in found.joints if j not in of_joints(header, joints).get(field, ())]
            lacks = f"{_PLAIN[field]} of {', '.join(absent) or 'all joints'}"
            break
    lacks = lacks or "a time, and velocities that tell the sample rate"
    return f"found {'; '.join(told) or 'none of the signals'}; not found: {lacks}"


def recognised(
    header: Sequence[str],
    table: Array,
    degrees: bool | None = None,
    joints: Sequence[str] = (),
) -> ColumnMap | None:
    """The map that names and values suggest; None if positions, efforts or a clock are not found.

    Args:
        header: names of all columns.
        table: values of some rows, NaN for a cell that is no number, shape (rows, columns).
        degrees: whether angles without a unit in their names are degrees; None: values decide.
        joints: the robot's joints: columns that are named after them are theirs, in this order.

    Raises:
        LogError: columns of one kind in different units, or a time in two columns.
    """
    found = _found(header, joints)
    times, groups, effort = found.times, found.groups, found.effort
    if found.lacks or effort is None:
        return None
    time = next(iter(times), None)
    count = len(groups["q"])
    if len(groups[effort]) != count or len(groups.get("qd", groups["q"])) != count:
        return None

    def numbers(columns: Sequence[str]) -> Array:
        return table[:, [list(header).index(name) for name in columns]]

    repair = {"repeat", "tail", "state"}
    used = {field: columns for field, columns in groups.items() if field in ("q", "qd", effort)}
    degrees, amperes, newton_metres = units_of(used, numbers, degrees)
    scale, clock = 1.0, 0.0
    if time is not None:
        refuse_unknown([time], TIME_UNITS)
        for name in times:
            _refuse_parts(name, numbers([name])[:, 0], header)
        t = numbers([time])[:, 0]
        steps = np.diff(t[np.isfinite(t)])
        repair |= {"order"} if (steps < 0).any() else set()
        scale = time_scale_of(time, t)
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
        joint_names=found.joints,
        repair=frozenset(repair),
    )


def _refuse_parts(time: str, t: Array, header: Sequence[str]) -> None:
    """Raise ``LogError`` if the time has whole seconds, and another column their fractions."""
    rest = [name for name in header if (unit_of(name, SECONDS) or 1.0) < 1e-3 and name != time]
    known = t[np.isfinite(t)]
    if rest and (known == np.floor(known)).all() and (np.diff(known) == 0).any():
        raise LogError(
            f"columns {time} and {rest[0]}: parts of one time, but auto reads one column; write "
            "their sum into one column of the file"
        )


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
    """Joint names, if the names of all columns contain them in the form of ROS's JointState."""
    found = [m.group(2) or m.group(3) for n in columns if (m := _NAMED.match(UNIT.sub("", n)))]
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
    time = f"time {_in_unit(columns.t, unit[columns.time_scale])}"
    if columns.t is None:
        time = f"no time, {columns.clock:g} rows per second by the velocities"
    scale = columns.torque_scale
    assert isinstance(scale, float)  # `recognised` makes no scale per joint
    torque = {1.0: "N m", 1e-2: "N cm", 1e-3: "mN m"}[abs(scale)]
    torque += ", opposite sign" if scale < 0 else ""
    parts = [time, f"positions {_in_unit(_span(columns.q), angle)}"]
    parts.append(
        f"velocities {_in_unit(_span(columns.qd), angle + '/s')}" if columns.qd else "no velocities"
    )
    parts.append(
        f"joint torques {_in_unit(_span(columns.torque), torque)}"
        if columns.torque
        else f"currents {_in_unit(_span(columns.current), ampere)}"
    )
    if "order" in columns.repair:
        parts.append("rows sorted by time")
    return ", ".join(parts)


def _span(names: Sequence[object]) -> str:
    return f"{names[0]} to {names[-1]}"


def _in_unit(names: object, unit: str) -> str:
    """Names with their unit, unless they end with it."""
    return str(names) if str(names).endswith(f"[{unit}]") else f"{names} [{unit}]"
