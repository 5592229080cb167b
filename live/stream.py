"""The interface of every robot stream: one sample at a time, read-only."""

from dataclasses import dataclass
from typing import Protocol, Self

from tauguard.arrays import Array

#: Largest number of events that a stream keeps.
MOST_EVENTS = 1000


class StreamClosed(Exception):
    """The stream has ended.

    Attributes:
        lost: True if the connection broke for good, False at the end of a log or input.
    """

    def __init__(self, why: str, lost: bool = False) -> None:
        """Take the reason ``why``, one line."""
        super().__init__(why)
        self.lost = lost


@dataclass(frozen=True, slots=True)
class Sample:
    """One sample of a robot."""

    t: float  #: the robot's own clock [s]
    q: Array  #: joint positions [rad], shape (n,)
    qd: Array  #: joint velocities [rad/s], shape (n,)
    current: Array  #: motor currents [A], shape (n,)
    arrived: int  #: this machine's monotonic clock at the packet's last byte [ns]


class RobotStream(Protocol):
    """A robot that is read and never commanded.

    To add another robot, write a class with these members; see ``docs/howto/live.md``.
    """

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of the samples."""

    @property
    def rate(self) -> float:
        """Sample rate [Hz]."""

    @property
    def events(self) -> list[str]:
        """Events of the connection so far, one line each: reconnects, lost packets."""

    def read(self, timeout: float) -> Sample | None:
        """The next sample, or None if none came within ``timeout`` seconds.

        Raises:
            StreamClosed: the stream has ended.
        """

    def close(self) -> None:
        """Close the connection; may be called twice."""


def add_event(events: list[str], event: str) -> None:
    """Append an event, unless there are ``MOST_EVENTS``."""
    if len(events) < MOST_EVENTS:
        events.append(event[:200])
    elif len(events) == MOST_EVENTS:
        events.append("more events are not listed")


class Closing:
    """Context manager of streams and servers: closes them at the end of the block."""

    def close(self) -> None:
        """Close; subclasses override this."""

    def __enter__(self) -> Self:
        """Return this object."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close this object."""
        self.close()
