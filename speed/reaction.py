"""What the robot does after it has detected a contact."""

from __future__ import annotations

from dataclasses import dataclass

from tauguard.findings import ArgumentError


@dataclass(frozen=True)
class Stop:
    """A stop of IEC 60204-1, or a retraction that follows it."""

    category: int = 2
    """0: power off at once, then brakes. 1: the drives stop the arm, then brakes. 2: the drives
    stop the arm and hold it."""
    deceleration: float = 10.0  #: of every joint [rad/s^2]
    start: str = "set_point"
    """Where the stop begins: "set_point": the controller's reference slows down and keeps its lead
    over the arm; "measured": the reference first jumps to the arm's position and speed."""
    retract: bool = False  #: after the stop, go back along the path at half the speed
    brake_delay: float = 0.02  #: from power off until the brakes hold [s]

    def __post_init__(self) -> None:
        """Check the values: ``ArgumentError`` says what is wrong."""
        if self.category not in (0, 1, 2):
            raise ArgumentError(f"stop: category {self.category!r}: expected 0, 1 or 2")
        if not self.deceleration > 0:
            raise ArgumentError(f"deceleration {self.deceleration} rad/s2: expected above 0")
        if self.start not in ("set_point", "measured"):
            raise ArgumentError(f"stop: start {self.start!r}: expected set_point or measured")
        if self.retract and self.category != 2:
            raise ArgumentError("stop: a retraction follows a stop of category 2 only")

    def __str__(self) -> str:
        if self.category == 0:
            return f"stop 0, brakes after {1e3 * self.brake_delay:g} ms"
        place = "along the set point" if self.start == "set_point" else "from the measured speed"
        back = ", then back" if self.retract else ""
        return f"stop {self.category} {place} at {self.deceleration:g} rad/s2{back}"
