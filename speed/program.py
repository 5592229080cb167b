"""A robot program: joint positions and velocities over time, divided into segments of motion."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from tauguard.arrays import Array, in_a_line
from tauguard.findings import ArgumentError
from tauguard.traces import Trace
from tauguard.untrusted_input import reading


@dataclass(frozen=True)
class Program:
    """Joint motion of a robot over time."""

    __repr__ = in_a_line

    name: str
    joint_names: tuple[str, ...]
    t: Array  #: increasing times [s], shape (T,)
    q: Array  #: joint positions [rad], shape (T, n)
    qd: Array  #: joint velocities [rad/s], shape (T, n)
    trace: Trace | None = None  #: the recording with its currents, which a detector needs

    def __post_init__(self) -> None:
        """Check the values: ``ArgumentError`` names the field and the first bad row."""
        shape = (len(self.t), len(self.joint_names))
        for name in ("t", "q", "qd"):
            value = np.asarray(getattr(self, name), dtype=np.float64)
            wanted = shape[:1] if name == "t" else shape
            if value.shape != wanted:
                raise ArgumentError(f"{name}: shape {value.shape}, expected {wanted}")
            if not np.isfinite(value).all():
                row = int(np.argmin(np.isfinite(value.reshape(len(value), -1)).all(axis=1)))
                raise ArgumentError(f"{name}: row {row} is not finite")
            object.__setattr__(self, name, value)
        if len(self.t) < 2 or (np.diff(self.t) <= 0).any():
            raise ArgumentError("t: expected two or more times that increase")

    @classmethod
    def from_trace(cls, trace: Trace, name: str = "trace") -> Program:
        """The motion of a recording."""
        return cls(name, trace.joint_names, trace.t, trace.q, trace.qd, trace)

    @classmethod
    def from_waypoints(
        cls,
        times: ArrayLike,
        q: ArrayLike,
        joint_names: tuple[str, ...] = (),
        name: str = "waypoints",
        rate: float = 100.0,
    ) -> Program:
        """A cubic spline through waypoints, at rest at both ends.

        Args:
            times: increasing times of the waypoints [s], shape (W,).
            q: joint positions [rad], shape (W, n).
            joint_names: names of the joints (default: joint_1 ...).
            name: name of the program.
            rate: samples per second.

        Raises:
            ArgumentError: fewer than two waypoints, times that do not increase, or wrong shapes.
        """
        at, points = np.asarray(times, dtype=np.float64), np.asarray(q, dtype=np.float64)
        if points.ndim != 2 or len(points) != len(at) or len(at) < 2 or (np.diff(at) <= 0).any():
            raise ArgumentError(
                f"times: shape {at.shape}, q: shape {points.shape}; expected (W,) increasing times "
                "and (W, n) positions of two or more waypoints"
            )
        spline = CubicSpline(at, points, bc_type="clamped")
        t = np.arange(at[0], at[-1], 1 / rate)
        names = joint_names or tuple(f"joint_{k}" for k in range(1, points.shape[1] + 1))
        return cls(name, names, t, spline(t), spline(t, 1))

    @property
    def seconds(self) -> float:
        """Duration [s]."""
        return float(self.t[-1] - self.t[0])

    def segments(self, still: float = 0.02, pause: float = 0.2) -> list[slice]:
        """Rows of each stretch of motion, in order of time.

        Args:
            still: a joint stands below this speed [rad/s].
            pause: shorter pauses belong to the motion, and shorter motions are left out [s].
        """
        moving = (np.abs(self.qd) > still).any(axis=1)
        edges = np.diff(np.concatenate([[False], moving, [False]]).astype(int))
        starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
        stretches: list[slice] = []
        for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
            if stretches and self.t[start] - self.t[stretches[-1].stop - 1] < pause:
                stretches[-1] = slice(stretches[-1].start, end)
            else:
                stretches.append(slice(start, end))
        return [s for s in stretches if self.t[s.stop - 1] - self.t[s.start] >= pause]


def advance(program: Program, row: int, end: int) -> float:
    """How far the program goes on in the direction of a sample's motion until row ``end`` [s].

    The furthest advance along the joint velocity of ``row``, over this velocity.
    """
    speed = program.qd[row]
    ahead = (program.q[row:end] - program.q[row]) @ speed / max(float(speed @ speed), 1e-12)
    return max(float(ahead.max()), 0.0)


def read_waypoints(path: str | Path) -> Program | None:
    """The program of a CSV whose columns are ``t, q1, q2, ...`` [s, rad]; None for another file.

    Raises:
        FileError: a cell that is no number.
    """
    with open(path, encoding="utf-8", errors="replace") as lines:
        header = [word.strip() for word in lines.readline().split(",")]
    joints = len(header) - 1
    if joints < 1 or header != ["t", *(f"q{k}" for k in range(1, joints + 1))]:
        return None
    with reading(path, "expected numbers in the columns t, q1, q2, ..."):
        table = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)
        return Program.from_waypoints(table[:, 0], table[:, 1:], name=Path(path).name)
