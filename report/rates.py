"""Proportions with their 95 % intervals."""

from __future__ import annotations

import numpy as np


def rate(successes: int, trials: int) -> dict[str, float | int | None]:
    """A proportion with its Wilson 95 % interval (Wilson 1927); all ``None`` where n is 0."""
    if trials == 0:
        return {"value": None, "low": None, "high": None, "n": 0}
    z = 1.959963984540054
    p = successes / trials
    centre = (p + z * z / (2 * trials)) / (1 + z * z / trials)
    half = z / (1 + z * z / trials) * np.sqrt(p * (1 - p) / trials + z * z / (4 * trials**2))
    low = 0.0 if successes == 0 else max(0.0, float(centre - half))
    high = 1.0 if successes == trials else min(1.0, float(centre + half))
    return {"value": p, "low": low, "high": high, "n": trials}
