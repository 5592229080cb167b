"""A log as packets of a robot, and faults that are injected into such packets."""

from __future__ import annotations

import difflib
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
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
        return Packets(
            self.due[chosen],
            self.t[chosen],
            self.q[chosen],
            self.qd[chosen],
            self.current[chosen],
        )


@dataclass(frozen=True)
class Fault:
    """A fault of the stream from ``start`` on for ``duration`` seconds."""

    name: str  #: one of ``FAULTS``
    start: float  #: seconds after the first packet
    duration: float = 1.0  #: [s]

    def __post_init__(self) -> None:
        """Check the name and the times.

        Raises:
            ValueError: an unknown name (the message lists the known ones), or a number out of
                range.
        """
        if self.name not in FAULTS:
            near = difflib.get_close_matches(self.name, FAULTS, n=1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            raise ValueError(f"no fault {self.name!r}: {hint}there are {', '.join(FAULTS)}")
        if not (np.isfinite(self.start) and self.start >= 0):
            raise ValueError(f"fault {self.name}: start {self.start} s, expected 0 or more")
        if not self.duration > 0:
            raise ValueError(f"fault {self.name}: lasts {self.duration} s, expected above 0")

    @classmethod
    def parse(cls, text: str) -> Fault:
        """A fault from ``NAME@SECONDS`` or ``NAME@SECONDS+DURATION``.

        Raises:
            ValueError: another form, or no such fault.
        """
        name, _, times = text.partition("@")
        start, plus, duration = times.partition("+")
        try:
            return cls(name, float(start), float(duration) if plus else 1.0)
        except ValueError as error:
            if "could not convert" not in str(error):
                raise
            raise ValueError(
                f"--fault {text}: expected NAME@SECONDS or NAME@SECONDS+DURATION, such as "
                "frozen@5 or bias@5+2"
            ) from None

    def apply(self, packets: Packets) -> Packets:
        """A copy of the packets with this fault."""
        inside = (packets.due >= self.start) & (packets.due < self.start + self.duration)
        rows = np.flatnonzero(inside)
        return FAULTS[self.name](packets, rows) if rows.size else packets


def _frozen(packets: Packets, rows: Rows) -> Packets:
    """The time stamps continue; every signal keeps its last value."""
    return _held(packets, rows, ("q", "qd", "current"))


def _stale(packets: Packets, rows: Rows) -> Packets:
    """The last packet is sent again and again, with its old time stamp."""
    return _held(packets, rows, ("t", "q", "qd", "current"))


def _held(packets: Packets, rows: Rows, names: tuple[str, ...]) -> Packets:
    held = {name: getattr(packets, name).copy() for name in names}
    for value in held.values():
        value[rows] = value[max(rows[0] - 1, 0)]
    return replace(packets, **held)


def _busiest(values: Array) -> int:
    """The column that changes most."""
    return int(np.argmax(np.ptp(values, axis=0)))


def _encoder(packets: Packets, rows: Rows) -> Packets:
    """The position of the joint that moves most stays constant; velocity and current go on."""
    joint = _busiest(packets.q[rows])
    q = packets.q.copy()
    q[rows, joint] = q[max(rows[0] - 1, 0), joint]
    return replace(packets, q=q)


def _missing(packets: Packets, rows: Rows) -> Packets:
    """No packets are sent."""
    return packets.rows(np.setdiff1d(np.arange(len(packets.due)), rows))


def _late(packets: Packets, rows: Rows) -> Packets:
    """All packets are sent in one burst at the end of the fault."""
    due = packets.due.copy()
    due[rows] = due[rows[-1]]
    return replace(packets, due=due)


def _repeated(packets: Packets, rows: Rows) -> Packets:
    """Every packet is sent twice."""
    return packets.rows(np.sort(np.concatenate([np.arange(len(packets.due)), rows])))


def _rate(packets: Packets, rows: Rows) -> Packets:
    """Only every second packet is sent."""
    return packets.rows(np.setdiff1d(np.arange(len(packets.due)), rows[1::2]))


def _jump(packets: Packets, rows: Rows) -> Packets:
    """The position of joint 1 reads 0.2 rad too much."""
    return _added(packets, rows, "q", 0, 0.2)


def _bias(packets: Packets, rows: Rows) -> Packets:
    """The current of joint 2 (or of the only joint) reads 2 A too much."""
    return _added(packets, rows, "current", min(1, packets.q.shape[1] - 1), 2.0)


def _added(packets: Packets, rows: Rows, name: str, joint: int, amount: float) -> Packets:
    value = getattr(packets, name).copy()
    value[rows, joint] += amount
    return replace(packets, **{name: value})


def _saturated(packets: Packets, rows: Rows) -> Packets:
    """Each current is clipped at half of its largest value."""
    current = packets.current.copy()
    most = np.abs(packets.current).max(axis=0) / 2
    current[rows] = np.clip(current[rows], -most, most)
    return replace(packets, current=current)


def _swapped(packets: Packets, rows: Rows) -> Packets:
    """The currents of the first two joints are exchanged."""
    current = packets.current.copy()
    current[rows, :2] = current[rows, 1::-1] if current.shape[1] > 1 else current[rows, :2]
    return replace(packets, current=current)


def _sign(packets: Packets, rows: Rows) -> Packets:
    """All currents have the opposite sign."""
    current = packets.current.copy()
    current[rows] *= -1
    return replace(packets, current=current)


def _nan(packets: Packets, rows: Rows) -> Packets:
    """The currents are NaN."""
    current = packets.current.copy()
    current[rows] = np.nan
    return replace(packets, current=current)


#: Faults by name, each described by its function's docstring.
FAULTS: dict[str, Callable[[Packets, Rows], Packets]] = {
    "frozen": _frozen,
    "stale": _stale,
    "encoder": _encoder,
    "missing": _missing,
    "late": _late,
    "repeated": _repeated,
    "rate": _rate,
    "jump": _jump,
    "bias": _bias,
    "saturated": _saturated,
    "swapped": _swapped,
    "sign": _sign,
    "nan": _nan,
}
