"""A case: what is given, where it comes from, and which answers are right."""

from __future__ import annotations

import json
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parent / "cases"
#: A time of impact may be early by this share of the step and is never late, but for one rounding.
EARLY = 1e-5
ROUNDING = 2.0**-52

Answer = float | bool | None


@dataclass(frozen=True)
class Case:
    """One question with a known answer.

    Attributes:
        name: unique.
        kind: the adapter's method that answers it.
        origin: where it was met first; ``of this project`` where it was made here.
        why: what makes it hard.
        given: the method's arguments by name.
        explained: why tauguard's own answer is wrong, where it is.
        expected: ``{"toi": "1/2"}`` (a fraction of the step; ``None``: no contact),
            ``{"overlap": true}``, or ``{"low": 0, "high": 1}``, bounds of a number.
    """

    name: str
    kind: str
    origin: str
    why: str
    given: dict[str, Any]
    expected: dict[str, Any]
    explained: str = ""

    def right(self, answer: Answer) -> bool:
        """Whether ``answer`` is right; a time is never late, and early by 1e-5 at most."""
        if "overlap" in self.expected:
            return isinstance(answer, bool) and answer == self.expected["overlap"]
        if "low" in self.expected:
            if not isinstance(answer, float):
                return False
            return bool(self.expected["low"] <= answer <= self.expected["high"])
        exact = self.exact
        if answer is None or exact is None:
            return answer is None and exact is None
        return float(exact) - EARLY <= answer <= float(exact) * (1 + ROUNDING)

    @property
    def exact(self) -> Fraction | None:
        """The exact time of impact; ``None`` where there is none."""
        toi = self.expected.get("toi")
        return None if toi is None else Fraction(toi)

    @property
    def expected_text(self) -> str:
        """The expected answer as text."""
        if "low" in self.expected:
            return f"{self.expected['low']:.7g} to {self.expected['high']:.7g}"
        if "overlap" in self.expected:
            return answer_text(self.expected["overlap"])
        return answer_text(None if self.exact is None else float(self.exact))


def answer_text(answer: Answer) -> str:
    """An answer as text."""
    if isinstance(answer, bool):
        return "contact" if answer else "apart"
    return "no contact" if answer is None else f"{answer:.10g}"


@cache
def load_cases() -> tuple[Case, ...]:
    """Every case of the folder ``cases``, in the order of its files."""
    files = ("queries", "convex", "scenes", "observer")
    texts = ((FOLDER / f"{name}.json").read_text() for name in files)
    return tuple(Case(**entry) for text in texts for entry in json.loads(text))
