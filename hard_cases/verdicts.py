"""Every case put to every library: one row an answer."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from tauguard.hard_cases.adapter import Adapter
from tauguard.hard_cases.case import Case, answer_text


def run(cases: Iterable[Case], libraries: Iterable[Adapter]) -> list[dict[str, Any]]:
    """Rows with ``case``, ``library``, ``expected``, ``answer``, ``right`` and what the case is.

    A library is not asked what it has no method for, or what raises ``NotImplementedError``. What
    else it raises is its answer, and wrong.
    """
    libraries = list(libraries)
    asked = [_row(case, one) for case in cases for one in libraries if hasattr(one, case.kind)]
    return [row for row in asked if row is not None]


def _row(case: Case, library: Adapter) -> dict[str, Any] | None:
    try:
        answer = getattr(library, case.kind)(**case.given)
        text, right = answer_text(answer), case.right(answer)
    except NotImplementedError:
        return None
    except Exception as error:
        text, right = f"{type(error).__name__}: {str(error).splitlines()[0]}", False
    return {
        "case": case.name,
        "library": library.name,
        "expected": case.expected_text,
        "answer": text,
        "right": right,
        "kind": case.kind,
        "why": case.why,
        "origin": case.origin,
        "explained": case.explained,
    }


def verdicts(rows: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """How many of each kind's cases each library answers, and how many rightly."""
    counts: dict[tuple[str, str], list[bool]] = {}
    for row in rows:
        counts.setdefault((row["kind"], row["library"]), []).append(row["right"])
    return [
        {"kind": kind, "library": library, "cases": len(all_), "right": sum(all_)}
        for (kind, library), all_ in counts.items()
    ]


def by_library(rows: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """The same as one row a kind and a column a library: ``11 of 13``, or None if not asked."""
    found = verdicts(rows)
    libraries = dict.fromkeys(one["library"] for one in found)
    kinds = dict.fromkeys(one["kind"] for one in found)
    right = {(f["kind"], f["library"]): f"{f['right']} of {f['cases']}" for f in found}
    return [{"kind": k} | {name: right.get((k, name)) for name in libraries} for k in kinds]
