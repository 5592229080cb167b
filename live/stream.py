"""What every live source gives: one sample at a time, read-only."""

from __future__ import annotations

from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self

from tauguard.arrays import Array


class StreamClosed(Exception):
    """The source has ended: the log is over, or the robot closed the connection for good."""


@dataclass(frozen=True, slots=True)
class Sample:
    """One sample of a robot."""

    t: float  #: the robot's own clock [s]
    q: Array  #: joint positions [rad], shape (n,)
    qd: Array  #: joint velocities [rad/s], shape (n,)
    current: Array  #: motor currents [A], shape (n,)
    arrived: int  #: this machine's monotonic clock when the packet was whole [ns]


class RobotStream(Protocol):
    """A robot that is read and never commanded.

    Another robot is one class with these members; see ``docs/howto/live.md``.
    """

    @property
    def joint_names(self) -> tuple[str, ...]:
        """What its joints are called, in the order of the samples."""

    @property
    def rate(self) -> float:
        """Samples a second that it sends."""

    @property
    def events(self) -> list[str]:
        """What happened to the connection so far, one line each: reconnects, lost packets."""

    def read(self, timeout: float) -> Sample | None:
        """The next sample, or None if none came within ``timeout`` seconds.

        Raises:
            StreamClosed: there will be no more.
        """

    def close(self) -> None:
        """Let go of the connection; may be called twice."""


class Closing:
    """``with`` for what is closed: a source, a server."""

    def close(self) -> None:
        """Overridden."""

    def __enter__(self) -> Self:
        """Itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close it."""
        self.close()
