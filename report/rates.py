"""Proportions with their 95 % intervals."""

from typing import Any


def rate(successes: int, trials: int) -> dict[str, Any]:
    """A proportion with its Wilson 95 % interval (Wilson 1927); all ``None`` where n is 0.

    Raises:
        ValueError: not 0 <= ``successes`` <= ``trials``.
    """
    from scipy.stats import binomtest

    if not 0 <= successes <= trials:
        raise ValueError(f"{successes} of {trials}: expected 0 <= successes <= trials")
    if trials == 0:
        return {"value": None, "low": None, "high": None, "n": 0}
    interval = binomtest(int(successes), int(trials)).proportion_ci(method="wilson")
    # The exact bounds at the ends; rounding would leave 1e-17 there.
    low = 0.0 if successes == 0 else float(interval.low)
    high = 1.0 if successes == trials else float(interval.high)
    return {"value": successes / trials, "low": low, "high": high, "n": trials}
