"""Run every case on every library, and count the verdicts."""

from collections.abc import Iterable
from typing import Any

from tauguard.hard_cases.adapter import Adapter
from tauguard.hard_cases.case import Case, answer_text


def run(cases: Iterable[Case], libraries: Iterable[Adapter]) -> list[dict[str, Any]]:
    """Run every case on every library and return one row for each answer.

    A row has ``case``, ``library``, ``expected``, ``answer``, ``right`` and ``wrong``, the error in
    a few words (:meth:`Case.wrong`). A case is skipped if the library has no method for its kind or
    the method raises ``NotImplementedError``. For any other exception ``wrong`` is ``failed``.
    """
    libraries = list(libraries)
    asked = [_row(case, one) for case in cases for one in libraries if hasattr(one, case.kind)]
    return [row for row in asked if row is not None]


def _row(case: Case, library: Adapter) -> dict[str, Any] | None:
    try:
        answer = getattr(library, case.kind)(**case.given)
        wrong = case.wrong(answer)
        text = answer_text(answer)
    except NotImplementedError:
        return None
    except Exception as error:
        lines = str(error).splitlines() or [""]
        text, wrong = f"{type(error).__name__}: {lines[0]}", "failed"
    return {
        "case": case.name,
        "library": library.name,
        "expected": case.expected_text,
        "answer": text,
        "right": not wrong,
        "wrong": wrong,
        "kind": case.kind,
        "why": case.why,
        "origin": case.origin,
        "explained": case.explained,
    }


def verdicts(rows: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """Count by kind and library: cases, right answers, and wrong answers by kind of error.

    ``missed_or_late`` lets bodies pass through each other. ``invented_or_early`` is conservative.
    ``other`` means out of bounds, not a number, or an exception.
    """
    found: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        found.setdefault((row["kind"], row["library"]), []).append(row["wrong"])
    return [
        {"kind": kind, "library": library, "cases": len(wrong), **_counts(wrong)}
        for (kind, library), wrong in found.items()
    ]


def _counts(wrong: list[str]) -> dict[str, int]:
    passes = sum(one.startswith(("missed", "late")) for one in wrong)
    cautious = sum(one.startswith(("invented", "early")) for one in wrong)
    right = wrong.count("")
    other = len(wrong) - right - passes - cautious
    return {
        "right": right,
        "missed_or_late": passes,
        "invented_or_early": cautious,
        "other": other,
    }


def by_library(rows: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """A row for each kind, a column for each library: ``11 of 13`` right, or None for no case."""
    found: dict[tuple[str, str], list[bool]] = {}
    for row in rows:
        found.setdefault((row["kind"], row["library"]), []).append(row["right"])
    libraries = dict.fromkeys(library for _, library in found)
    kinds = dict.fromkeys(kind for kind, _ in found)
    texts = {key: f"{sum(right)} of {len(right)}" for key, right in found.items()}
    return [{"kind": k} | {name: texts.get((k, name)) for name in libraries} for k in kinds]
