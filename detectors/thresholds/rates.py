"""Peaks of scores and their tails."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def sustained(score: Array, samples: int) -> Array:
    """The level that the last ``samples`` scores all reach, shape (T,): an alarm needs it."""
    if samples <= 1:
        return score
    padded = np.concatenate((np.full(samples - 1, -np.inf), score))
    lowest: Array = np.lib.stride_tricks.sliding_window_view(padded, samples).min(axis=-1)
    return lowest


def block_maxima(level: Array, rows: int) -> tuple[Array, NDArray[np.intp]]:
    """The maximum of each block of ``rows`` samples (the last may be shorter) and its row."""
    rows = max(1, rows)
    padded = np.append(level, np.full(-len(level) % rows, -np.inf)).reshape(-1, rows)
    where = padded.argmax(axis=1) + rows * np.arange(len(padded))
    return level[where], where


def followed(peaks: Array, allowed: float, count: int) -> float:
    """The level that ``allowed`` peaks exceed, or are expected to where that is fewer than one.

    Then it lies on an exponential tail through the ``count`` largest; never below the largest.

    Args:
        peaks: in descending order, shape (N,), N >= 1.
        allowed: above 0.
        count: at most N - 1 are used.
    """
    if allowed >= 1:
        return float(peaks[min(int(allowed), len(peaks) - 1)])
    count = min(count, len(peaks) - 1)
    base = float(peaks[count])
    mean_excess = float(np.mean(peaks[:count] - base)) if count else 0.0
    level = base + mean_excess * float(np.log(max(count, 1) / allowed))
    return max(level, float(np.nextafter(peaks[0], np.inf)))


#: Bounds of the tail's shape: no finite end closer than that of a triangle's, no heavier tail than
#: a few dozen peaks can tell from an exponential.
SHAPES = (-0.5, 0.2)


def tail_level(peaks: Array, allowed: float, count: int) -> float:
    """The level that ``allowed`` peaks are expected to exceed, along a generalised Pareto tail.

    The excesses of the ``count`` largest peaks over the next one tell scale and shape by
    probability-weighted moments (Hosking & Wallis 1987). Unlike an exponential tail it can end: a
    score that has a highest value is not extrapolated far beyond it.

    Args:
        peaks: in descending order, shape (N,), N >= 1.
        allowed: above 0; at or above ``count`` it is the peak that so many exceed.
        count: at most N - 1 are used.

    Raises:
        ValueError: no peaks, or a number allowed that is not above 0.
    """
    if not (len(peaks) and allowed > 0):
        raise ValueError(f"{len(peaks)} peaks, {allowed} allowed: expected some, and above 0")
    count = min(count, len(peaks) - 1)
    if allowed >= max(count, 1):
        return float(peaks[min(int(allowed), len(peaks) - 1)])
    if count < 2:
        return float(peaks[0])
    base = float(peaks[count])
    excess = peaks[:count] - base
    mean = float(excess.mean())
    # The largest comes first: its probability of being exceeded is the smallest.
    exceeded = (np.arange(1, count + 1) - 0.65) / count
    weighted = float(np.mean(excess * exceeded))
    if not mean - 2 * weighted > 1e-12 * max(mean, 1e-300):
        return float(peaks[0])
    shape = float(np.clip(2 - mean / (mean - 2 * weighted), *SHAPES))
    scale, ratio = mean * (1 - shape), count / allowed
    grown = np.log(ratio) if abs(shape) < 1e-9 else (ratio**shape - 1) / shape
    return base + scale * float(grown)
