"""Lines of the summary: the worst of several values and its target."""

from collections.abc import Iterable, Sequence

from studies.framework import answer, timed
from tauguard.report import Row


def faster(question: str, ratio: float, ratios: Sequence[float], quick: bool) -> Row:
    """Require the smallest ratio of times to reach ``ratio``."""
    least = min(ratios)
    return answer(question, f"at least {ratio:g}", f"{least:.3g}", timed(least >= ratio, quick))


def within(question: str, bound: float, times: Sequence[float], quick: bool) -> Row:
    """Require the longest time to be at most ``bound``."""
    most = max(times)
    return answer(question, f"at most {bound:g}", f"{most:.3g}", timed(most <= bound, quick))


def error(question: str, bound: float, values: Iterable[float | None]) -> Row:
    """Require the largest error, or number of errors, to be at most ``bound``."""
    known = [value for value in values if value is not None]
    if not known:
        return answer(question, f"at most {bound:g}", "not measured")
    return answer(question, f"at most {bound:g}", f"{max(known):.3g}", max(known) <= bound)


def count(rate: Row) -> float:
    """The number of cases that a rate counts: its value times ``n``."""
    return 0.0 if rate["value"] is None else float(round(rate["value"] * rate["n"]))
