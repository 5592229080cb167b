"""Column maps: from the columns of a CSV file to the signals of a trace."""

from __future__ import annotations

import dataclasses
import re
import tomllib
from collections.abc import Collection
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

from tauguard.findings import ArgumentError, LogError, cause
from tauguard.untrusted_input import read_json, reading

Column = str | int

#: Fields of a map that name one column per joint.
SIGNALS = ("q", "qd", "current", "torque", "q_des", "qd_des", "qdd_des")
#: Kinds of repair, see :attr:`ColumnMap.repair`.
REPAIRS = ("repeat", "tail", "nan", "state", "order")
#: Seconds in one unit of a time column, by the unit's name.
CLOCK_UNITS = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}

#: Units of angles, and whether they are degrees.
ANGLES = {"deg": True, "rad": False}


@dataclass(frozen=True)
class ColumnMap:
    """Columns by name (of the header line) or by 0-based index; one column per joint, in order.

    A map that has only indices reads files with and without a header line.
    """

    t: Column | None  #: time; None: there is none, see ``clock``
    q: tuple[Column, ...]  #: joint positions
    qd: tuple[Column, ...] = ()  #: joint velocities; none: positions are differentiated
    current: tuple[Column, ...] = ()  #: motor currents [A]
    torque: tuple[Column, ...] = ()  #: joint torques [N m], instead of currents
    q_des: tuple[Column, ...] = ()  #: commanded positions
    qd_des: tuple[Column, ...] = ()  #: commanded velocities
    qdd_des: tuple[Column, ...] = ()  #: commanded accelerations
    degrees: bool | tuple[bool, ...] = False
    """Whether angles, their speeds and accelerations are in degrees: one value, or one per joint (a
    linear axis, in m: false)."""
    time_scale: float = 1.0  #: seconds in one unit of the time column (1e-3: milliseconds)
    current_scale: float | tuple[float, ...] = 1.0  #: amperes per logged unit; one or n values
    torque_scale: float | tuple[float, ...] = 1.0
    """N m per logged unit, one or n values; negative if the log's sign is not the robot's."""
    clock: float = 0.0  #: sample rate if there is no time column [Hz]
    separator: str = ","
    decimal: str = "."  #: decimal mark
    joint_names: tuple[str, ...] = ()  #: empty: unknown
    width: int | None = None  #: number of columns of every row; None: not known
    headerless: bool = False  #: files have no header line; one with a header is refused
    repair: frozenset[str] = field(default_factory=frozenset)
    """Allowed repairs. "order" sorts rows by time. Each other word drops rows: "repeat" a row with
    the time of the previous row, "tail" a last row that is cut off, "nan" a row with a number that
    is missing or not finite, "state" a row with the whole state of the previous row (written by
    recorders that are faster than their robot)."""

    def __post_init__(self) -> None:
        """Check that all joints have their columns.

        Raises:
            LogError: different numbers of columns, an unknown kind of repair.
        """
        self._check_types()
        joints = len(self.q)
        if joints == 0:
            raise LogError("columns.q: name at least one joint's column")
        for name, group in self.groups().items():
            if len(group) != joints:
                raise LogError(f"columns.{name}: {len(group)} columns for {joints} joints")
        for name in ("current_scale", "torque_scale", "degrees"):
            scale = getattr(self, name)
            if not isinstance(scale, float | int) and len(scale) != joints:
                raise LogError(f"columns.{name}: one value or {joints}")
        if bool(self.current) == bool(self.torque):
            raise LogError("columns: give either current [A] or torque [N m]")
        unknown = self.repair - set(REPAIRS)
        if unknown:
            raise LogError(f"columns.repair: {sorted(unknown)}; known: {', '.join(REPAIRS)}")

    def _check_types(self) -> None:
        """Refuse wrong types: the text "false" would count as true."""
        columns = [c for name in SIGNALS for c in getattr(self, name)]
        columns += [] if self.t is None else [self.t]
        if (self.t is None) != (self.clock > 0):
            raise LogError(
                "columns: give t (the time's column) or clock (rows per second), not both"
            )
        for column in columns:
            if isinstance(column, bool) or not isinstance(column, str | int):
                raise LogError(f"column {column!r}: expected a name or a number from 0")
        told = self.degrees if isinstance(self.degrees, tuple) else (self.degrees,)
        if not all(isinstance(one, bool) for one in told):
            raise LogError(f"columns.degrees: {self.degrees!r}, expected true or false")
        scales: list[object] = [self.time_scale]
        for one in (self.current_scale, self.torque_scale):
            scales += one if isinstance(one, tuple | list) else (one,)
        for scale in scales:
            if isinstance(scale, bool) or not (isinstance(scale, float | int) and abs(scale) > 0):
                raise LogError(f"columns: scale {scale!r}, expected a number other than 0")
        if not (isinstance(self.separator, str) and len(self.separator) == 1):
            raise LogError(f"columns.separator: {self.separator!r}, expected one character")
        if self.decimal not in (".", ",") or self.decimal == self.separator:
            raise LogError(
                f"columns.decimal: {self.decimal!r}, expected . or , and not the separator"
            )

    def groups(self) -> dict[str, tuple[Column, ...]]:
        """The columns of each signal that the map has, by the name of the trace's field."""
        return {n: getattr(self, n) for n in SIGNALS if n == "q" or getattr(self, n)}

    @property
    def times(self) -> tuple[Column, ...]:
        """The column of the time, if there is one."""
        return () if self.t is None else (self.t,)

    def mended(self, words: Collection[str]) -> ColumnMap:
        """The map with other units, repairs or a clock.

        Args:
            words: "deg" or "rad" (angles), "mA" (currents), "ms", "us" or "ns" (time), a repair,
                or "clock=HZ".

        Raises:
            ArgumentError: an unknown word.
        """
        changed: dict[str, Any] = {"repair": self.repair | (set(words) & set(REPAIRS))}
        for word in words:
            changed |= changed_fields(word)
        return dataclasses.replace(self, **changed)


def changed_fields(word: str) -> dict[str, Any]:
    """The fields of a map that a word of ``mend`` changes; none for a repair.

    Raises:
        ArgumentError: an unknown word.
    """
    name, _, value = word.partition("=")
    if word in ANGLES:
        return {"degrees": ANGLES[word]}
    if word == "mA":
        return {"current_scale": 1e-3}
    if word in CLOCK_UNITS:
        return {"time_scale": CLOCK_UNITS[word]}
    if name == "clock" and re.fullmatch(r"[0-9.]+", value) and float(value) > 0:
        return {"t": None, "clock": float(value)}
    if word in REPAIRS:
        return {}
    words = ", ".join((*ANGLES, "mA", *CLOCK_UNITS, *REPAIRS, "clock=HZ"))
    raise ArgumentError(cause("mend", f'`mend="{word}"`: expected some of {words}'))


@dataclass(frozen=True)
class Reading:
    """Flags of all commands that read logs of a real arm."""

    mend: tuple[str, ...] = ()
    """units and repairs of CSV files: deg or rad (angles), mA (currents), ms, us or ns (time),
    clock=HZ (no time column), order (sort rows by time); drop rows that repeat a time (repeat) or
    the whole state (state), rows that lack numbers (nan), a last row that is cut off (tail)"""
    resample: float = 0.0
    """reduce logs to this sample rate [Hz]: each sample is the mean of the interval before it,
    which delays signals by half an interval; 0: unchanged"""


#: Reads logs unchanged.
AS_IS = Reading()


def _map_of(fields: dict[str, Any]) -> ColumnMap:
    """The map in a JSON or TOML file, whose lists become tuples."""
    values: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in fields.items()}
    if "repair" in values:
        values["repair"] = frozenset(values["repair"])
    return ColumnMap(**values)


_TEXT = files("tauguard.datasets").joinpath("presets.toml").read_text("utf-8")
#: Maps of known formats by name.
PRESETS = {name: _map_of(fields) for name, fields in tomllib.loads(_TEXT).items()}


def preset_of(columns: ColumnMap) -> str | None:
    """Name of the preset that a map equals in all fields but :data:`_FORM`; None: no preset."""
    for name, known in PRESETS.items():
        own = {n: getattr(known, n) for n in _FORM}
        if dataclasses.replace(columns, **own) == known:
            return name
    return None


#: Units, repairs and format of a row; maps of the same columns may differ in these fields.
_FORM = ("separator", "decimal", "degrees", "time_scale", "current_scale", "repair")


def presets_of(header: Collection[str]) -> list[str]:
    """Names of the presets whose columns a header line has."""
    found = []
    for name, preset in PRESETS.items():
        wanted = [*preset.times, *(c for group in preset.groups().values() for c in group)]
        if all(isinstance(c, str) and c in header for c in wanted):
            found.append(name)
    return found


def presets_of_width(width: int) -> list[str]:
    """Names of the presets for files without a header line whose rows have ``width`` columns."""
    return [name for name, one in PRESETS.items() if one.headerless and one.width == width]


def column_map(columns: ColumnMap | str | Path | None) -> ColumnMap | str | None:
    """The map in the JSON file ``columns``; a map or the name of a preset is returned unchanged.

    Raises:
        ArgumentError: no such file or preset.
        LogError: not the fields of a :class:`ColumnMap`.
    """
    if columns is None or isinstance(columns, ColumnMap):
        return columns
    columns = str(columns)
    if columns == "auto" or columns in PRESETS:
        return columns
    presets = f"presets are {', '.join(PRESETS)}"
    if not columns.endswith(".json"):
        raise ArgumentError(cause("columns", f"columns {columns!r}: {presets}, or auto"))
    if not Path(columns).is_file():
        raise ArgumentError(cause("columns", f"{columns}: no such file; {presets}"))
    fields = read_json(columns)
    known = [field.name for field in dataclasses.fields(ColumnMap)]
    fields_are = f"its fields are {', '.join(known)}"
    if not isinstance(fields, dict):
        raise LogError(f"{columns}: expected an object; {fields_are}")
    if strange := sorted(set(fields) - set(known)):
        raise LogError(f"{columns}: unknown {', '.join(strange)}; {fields_are}")
    fields.setdefault("t", None) if "clock" in fields else None
    if missing := [name for name in ("t", "q") if name not in fields]:
        raise LogError(f"{columns}: {', '.join(missing)} missing; {fields_are}")
    with reading(columns, fields_are):
        return _map_of(fields)
