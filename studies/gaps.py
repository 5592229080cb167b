"""What of a report cannot be shown, and why: it is named, and the rest is made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

#: Characters of one line.
LENGTH = 300

T = TypeVar("T")


@dataclass
class Gaps:
    """The parts that are missing, a line each, in the order in which they were found."""

    lines: list[str] = field(default_factory=list)

    def add(self, what: str, why: str) -> None:
        """Name a part and why it is not there; control characters of foreign text are left out."""
        text = " ".join(f"{what}: {why}".split())
        self.lines.append("".join(c if c.isprintable() else "?" for c in text)[:LENGTH])

    def attempt(self, what: str, make: Callable[[], T], instead: T) -> T:
        """What ``make`` returns; ``instead``, and a line, where the rows are not as it expects.

        A file may be of another build, of a part of a study, or of somebody else: any error is
        possible, and each is named.
        """
        try:
            return make()
        except Exception as error:
            self.add(what, said(error))
            return instead


def said(error: Exception) -> str:
    """An error in words."""
    if isinstance(error, KeyError):
        return f"no {error} in its rows"
    return f"{type(error).__name__}: {error}"
