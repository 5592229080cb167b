"""Proportions and rates with their intervals."""

import math
from typing import Any

from tauguard.findings import ArgumentError


def rate(successes: int, trials: int) -> dict[str, Any]:
    """A proportion with its Wilson 95 % interval (Wilson 1927); all ``None`` where n is 0.

    Raises:
        ArgumentError: not 0 <= ``successes`` <= ``trials``.
    """
    from scipy.special import ndtri  # scipy.stats loads for seconds

    if not 0 <= successes <= trials:
        raise ArgumentError(f"{successes} of {trials}: expected 0 <= successes <= trials")
    if trials == 0:
        return {"value": None, "low": None, "high": None, "n": 0}
    n, share, z = int(trials), int(successes) / int(trials), float(ndtri(0.975))
    middle = (2 * n * share + z**2) / (2 * (n + z**2))
    side = z / (2 * (n + z**2)) * math.sqrt(4 * n * share * (1 - share) + z**2)
    # At the ends the bounds are exactly 0 or 1; rounding would leave 1e-17.
    low = 0.0 if successes == 0 else middle - side
    high = 1.0 if successes == trials else middle + side
    return {"value": successes / trials, "low": low, "high": high, "n": trials}


def poisson_rate(count: int, hours: float, confidence: float = 0.95) -> dict[str, Any]:
    """Events per hour with the exact (Garwood) Poisson interval; ``n`` is the count.

    Raises:
        ArgumentError: a count or hours below 0.
    """
    from scipy.special import gammaincinv

    if count < 0 or not hours >= 0:
        raise ArgumentError(f"{count} events in {hours} h: expected 0 or more")
    if hours == 0:
        return {"value": None, "low": None, "high": None, "n": count, "hours": 0.0}
    side = (1 - confidence) / 2
    low = 0.0 if count == 0 else float(gammaincinv(count, side))
    high = float(gammaincinv(count + 1, 1 - side))
    return {
        "value": count / hours,
        "low": low / hours,
        "high": high / hours,
        "n": count,
        "hours": hours,
    }
