"""A log as packets of a robot, and faults that are injected into such packets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.findings import ArgumentError
from tauguard.traces.trace import Trace

Rows = NDArray[np.int64]


@dataclass(frozen=True)
class Packets:
    """Packets to send, in order; unlike a trace they may hold NaN and times that go back."""

    due: Array  #: time of sending after the first packet [s], shape (P,)
    t: Array  #: the time stamp inside [s], shape (P,)
    q: Array  #: [rad], shape (P, n)
    qd: Array  #: [rad/s], shape (P, n)
    current: Array  #: [A], shape (P, n)

    @classmethod
    def of(cls, trace: Trace) -> Packets:
        """One packet per sample, sent at the sample's time."""
        return cls(trace.t - trace.t[0], trace.t, trace.q, trace.qd, trace.current)

    def rows(self, chosen: Rows) -> Packets:
        """Some of the packets."""
        return Packets(*(getattr(self, field.name)[chosen] for field in fields(self)))


@dataclass(frozen=True)
class Fault:
    """A fault of the stream from ``start`` on for ``duration`` seconds."""

    name: str  #: one of ``FAULTS``
    start: float  #: seconds after the first packet
    duration: float = 1.0  #: [s]

    def __post_init__(self) -> None:
        """Raise ``ArgumentError`` for an unknown name, or a number out of range."""
        if self.name not in FAULTS:
            raise ArgumentError(f"no fault {self.name!r}: there are {', '.join(FAULTS)}")
        if not (np.isfinite(self.start) and self.start >= 0):
            raise ArgumentError(f"fault {self.name}: start {self.start} s, expected 0 or more")
        if not self.duration > 0:
            raise ArgumentError(f"fault {self.name}: lasts {self.duration} s, expected above 0")

    @classmethod
    def parse(cls, text: str) -> Fault:
        """A fault from ``NAME@SECONDS`` or ``NAME@SECONDS+DURATION``.

        Raises:
            ArgumentError: another form, or no such fault.
        """
        name, _, times = text.partition("@")
        start, plus, duration = times.partition("+")
        try:
            numbers = float(start), float(duration) if plus else 1.0
        except ValueError:
            raise ArgumentError(
                f'`fault="{text}"`: expected NAME@SECONDS or NAME@SECONDS+DURATION, such as '
                "frozen@5 or bias@5+2"
            ) from None
        return cls(name, *numbers)

    def apply(self, packets: Packets) -> Packets:
        """A copy of the packets with this fault."""
        inside = (packets.due >= self.start) & (packets.due < self.start + self.duration)
        rows = np.flatnonzero(inside)
        return FAULTS[self.name](packets, rows) if rows.size else packets


Change = Callable[[Packets, Rows], Packets]


def _set(name: str, values: Callable[[Array, Rows], Array]) -> Change:
    """A fault of one signal: its values in the rows are ``values(signal, rows)``."""

    def change(packets: Packets, rows: Rows) -> Packets:
        signal = getattr(packets, name).copy()
        signal[rows] = values(signal, rows)
        return replace(packets, **{name: signal})

    return change


def _held(*names: str) -> Change:
    """A fault in which signals keep the value that they had before it."""

    def change(packets: Packets, rows: Rows) -> Packets:
        for name in names:
            packets = _set(name, _last)(packets, rows)
        return packets

    return change


def _last(signal: Array, rows: Rows) -> Array:
    return np.asarray(signal[max(rows[0] - 1, 0)])


def _sent(chosen: Callable[[Rows, Rows], Rows]) -> Change:
    """A fault in which only the packets ``chosen(all, rows)`` are sent."""
    return lambda packets, rows: packets.rows(chosen(np.arange(len(packets.due)), rows))


def _stuck(q: Array, rows: Rows) -> Array:
    """Positions in which the joint that moves most keeps its last value."""
    held = q[rows]
    joint = int(np.argmax(np.ptp(held, axis=0)))
    held[:, joint] = _last(q, rows)[joint]
    return held


def _plus(joint: int, amount: float) -> Callable[[Array, Rows], Array]:
    """Values of a signal with an amount added to one joint, or to the only one."""
    return lambda x, rows: x[rows] + amount * (np.arange(x.shape[1]) == min(joint, x.shape[1] - 1))


def _clipped(current: Array, rows: Rows) -> Array:
    most = np.abs(current).max(axis=0) / 2
    return np.clip(current[rows], -most, most)


def _exchanged(current: Array, rows: Rows) -> Array:
    return np.hstack([current[rows, 1:2], current[rows, :1], current[rows, 2:]])


#: Faults by name.
FAULTS: dict[str, Change] = {
    "frozen": _held("q", "qd", "current"),  # the time stamps continue
    "stale": _held("t", "q", "qd", "current"),  # one packet is sent again and again
    "encoder": _set("q", _stuck),  # velocity and current go on
    "missing": _sent(np.setdiff1d),
    "late": _set("due", lambda due, rows: due[rows[-1]]),  # one burst at the end of the fault
    "repeated": _sent(lambda every, rows: np.sort(np.append(every, rows))),  # each is sent twice
    "rate": _sent(lambda every, rows: np.setdiff1d(every, rows[1::2])),  # every second is sent
    "jump": _set("q", _plus(0, 0.2)),  # joint 1 reads 0.2 rad too much
    "bias": _set("current", _plus(1, 2.0)),  # joint 2 reads 2 A too much
    "saturated": _set("current", _clipped),  # at half of each joint's largest current
    "swapped": _set("current", _exchanged),  # the first two joints
    "sign": _set("current", lambda current, rows: -current[rows]),
    "nan": _set("current", lambda current, rows: np.full_like(current[rows], np.nan)),
}
