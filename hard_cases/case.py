"""A case: its input, its origin, and the right answers."""

import json
import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

FOLDER = Path(__file__).parent / "cases"
#: The kinds of questions; the adapter's method of the same name answers them.
KINDS = (
    "vertex_face",
    "edge_edge",
    "convex_overlap",
    "convex_sweep",
    "convex_motion",
    "mesh_distance",
    "point_in_mesh",
    "mesh_ray",
    "scene",
    "observer",
)
#: A right time of impact is early by at most this fraction of the step.
EARLY = 1e-5
#: Relative error of one rounding, by which a right time of impact may be late.
ROUNDING = 2.0**-52

Answer = float | bool | None


@dataclass(frozen=True)
class Case:
    """One question with a known answer.

    Attributes:
        name: unique name.
        kind: name of the adapter's method that answers the question.
        origin: where the case was first found; ``of this project`` if it was made for this list.
        why: what makes the case hard.
        given: arguments of the method by name.
        explained: the reason, if tauguard's own answer is wrong.
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

    def right(self, answer: object) -> bool:
        """Whether ``answer`` is right; a time must not be late, and may be early by 1e-5.

        Raises:
            TypeError: as :meth:`wrong`.
        """
        return not self.wrong(answer)

    def wrong(self, answer: object) -> str:
        """The error of ``answer`` in a few words; empty if it is right.

        ``missed`` and ``late by ...`` let bodies pass through each other. ``invented`` and ``early
        by ...`` are conservative. Other texts are ``out of bounds`` and ``not a number``.

        Raises:
            TypeError: ``answer`` has a wrong type for the question.
        """
        said, exact = self._plain(answer), self.exact
        if "low" in self.expected:
            assert said is not None
            inside = self.expected["low"] <= said <= self.expected["high"]
            return "" if inside else "out of bounds"
        if "overlap" in self.expected:
            there, found = self.expected["overlap"], bool(said)
        else:
            there, found = exact is not None, said is not None
        if not (there and found):
            return "" if there == found else "missed" if there else "invented"
        return "" if exact is None or said is None else mistimed(float(exact), said)

    def _plain(self, answer: object) -> Answer:
        """The answer as a bool, a float or None; NumPy scalars are converted."""
        said: Any = answer.item() if isinstance(answer, np.generic) else answer
        number = isinstance(said, int | float) and not isinstance(said, bool)
        if "overlap" in self.expected:
            expected, fits = "bool", isinstance(said, bool)
        elif "low" in self.expected:
            expected, fits = "float", number
        else:
            expected, fits = "float or None", number or said is None
        if not fits:
            raise TypeError(f"the answer is of type {type(answer).__name__}, expected {expected}")
        plain: Answer = said
        return plain

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


def mistimed(exact: float, said: float) -> str:
    """The error of a time beyond the tolerance, as text; empty within the tolerance."""
    if exact - EARLY <= said <= exact * (1 + ROUNDING):
        return ""
    if math.isnan(said):
        return "not a number"
    return f"late by {said - exact:.2g}" if said > exact else f"early by {exact - said:.2g}"


def answer_text(answer: Any) -> str:
    """An answer as text."""
    answer = answer.item() if isinstance(answer, np.generic) else answer
    if isinstance(answer, bool):
        return "contact" if answer else "apart"
    return "no contact" if answer is None else f"{answer:.10g}"


@cache
def load_cases() -> tuple[Case, ...]:
    """Every case of the folder ``cases``, in the order of its files."""
    files = ("queries", "convex", "meshes", "scenes", "observer")
    texts = ((FOLDER / f"{name}.json").read_text("utf-8") for name in files)
    return tuple(Case(**entry) for text in texts for entry in json.loads(text))
