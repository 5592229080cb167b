"""A threshold with a guarantee of the rate of false alarms, for motion like the calibration's.

The method is split-conformal calibration of motion episodes. Successive samples are not
exchangeable, because stick-slip and payloads last longer than a sample. Episodes that are drawn in
the same way are exchangeable. So the rank of a new episode's peak among the peaks of n calibration
episodes is uniformly distributed.
With the (k + 1)-th largest peak as the threshold, the probability p of an alarm in a new episode
has the distribution Beta(k + 1, n - k), whatever the detector and the motion (Vovk 2012). Hence
P(p > alpha) = P(Binomial(n, alpha) <= k). The largest k is used for which this is at most 1 -
confidence.

An episode can have several alarms, m on average if it has any. So alpha is the accepted rate, times
the length of an episode, divided by m. m is counted at a lower threshold that enough calibration
episodes exceed, because m decreases with the threshold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tauguard.detectors.thresholds.free_scores import FreeScores
from tauguard.findings import ArgumentError, RefusedError, cause

#: Alarms per episode are counted at a threshold that COUNTED episodes exceed, or FRACTION of all
#: episodes if that number is smaller.
COUNTED, FRACTION = 30, 0.25


@dataclass(frozen=True)
class Guarantee:
    """A calibrated threshold and its guarantee."""

    threshold: float  #: of the score
    per_hour: float  #: guaranteed rate of false alarms [1/h]
    confidence: float  #: probability over calibration sets that the guarantee holds
    episodes: int  #: number of calibration episodes
    hours: float  #: total length of the calibration episodes [h]
    allowed: int  #: largest number of calibration episodes with an alarm at the threshold
    alarms_an_episode: float  #: mean number of alarms of an episode with any


def guaranteed_threshold(
    episodes: Sequence[FreeScores], per_hour: float, confidence: float = 0.95
) -> Guarantee:
    """The lowest threshold that guarantees at most ``per_hour`` false alarms on fresh episodes.

    Args:
        episodes: collision-free, not trained on, and drawn in the same way as the episodes for
            which the guarantee is to hold.
        per_hour: accepted false alarms per hour, above 0.
        confidence: probability that calibration episodes drawn in this way give a threshold for
            which the guarantee holds, between 0 and 1.

    Raises:
        ArgumentError: bad arguments.
        RefusedError: too few episodes; the message says how many are enough.
    """
    check_guarantee([e.seconds for e in episodes], per_hour, confidence)
    count = len(episodes)
    hours = sum(e.seconds for e in episodes) / 3600
    peaks = np.sort([e.peak for e in episodes])[::-1]
    several, counted = 0.0, min(COUNTED, int(FRACTION * count))
    # Count at a threshold that at least as many episodes exceed; above it, an episode has fewer
    # alarms.
    while (now := _alarms_an_episode(episodes, float(peaks[counted]))) > several:
        several = now
        alpha = min(1.0, per_hour * hours / count / several)
        allowed = allowed_episodes(count, alpha, confidence)
        counted = max(counted, allowed)
    if allowed < 0:
        raise _too_few(count, hours, alpha, per_hour, confidence)
    return Guarantee(float(peaks[allowed]), per_hour, confidence, count, hours, allowed, several)


def check_guarantee(seconds: Sequence[float], per_hour: float, confidence: float) -> None:
    """Refuse episodes that are too few or too short for the guarantee with any detector.

    It is assumed that no episode has two alarms; if some have, :func:`guaranteed_threshold` needs
    more episodes.

    Args:
        seconds: length of each collision-free episode [s].
        per_hour: accepted false alarms per hour, above 0.
        confidence: between 0 and 1.

    Raises:
        ArgumentError: bad arguments.
        RefusedError: too few episodes; the message says how many are enough.
    """
    if not per_hour > 0:
        raise ArgumentError(f"per_hour: {per_hour}, expected above 0")
    if not 0 < confidence < 1:
        raise ArgumentError(f"confidence: {confidence}, expected between 0 and 1")
    if not seconds:
        raise ArgumentError("no episodes to calibrate on")
    count, hours = len(seconds), sum(seconds) / 3600
    alpha = min(1.0, per_hour * hours / count)
    if allowed_episodes(count, alpha, confidence) < 0:
        raise _too_few(count, hours, alpha, per_hour, confidence)


def _too_few(
    count: int, hours: float, alpha: float, per_hour: float, confidence: float
) -> RefusedError:
    needed = int(np.ceil(np.log(1 - confidence) / np.log1p(-alpha)))
    text = (
        f"{count} episodes ({hours:.2g} h) cannot guarantee {per_hour:g} false alarms per hour "
        f"with confidence {confidence:g}: give {needed} ({hours * needed / count:.2g} h), "
        "or ask for more alarms or less confidence"
    )
    return RefusedError(cause("too-short", text))


def allowed_episodes(count: int, alpha: float, confidence: float) -> int:
    """The largest k with P(Binomial(count, alpha) <= k) <= 1 - confidence; -1 if there is none."""
    from scipy import stats

    k = int(stats.binom.ppf(1 - confidence, count, alpha)) + 1
    while k >= 0 and stats.binom.cdf(k, count, alpha) > 1 - confidence:
        k -= 1
    return k


def _alarms_an_episode(episodes: Sequence[FreeScores], threshold: float) -> float:
    """Mean number of alarms, at ``threshold``, of an episode with any; at least 1."""
    counts = [n for e in episodes if (n := e.alarms(threshold)) > 0]
    return max(1.0, float(np.mean(counts))) if counts else 1.0
