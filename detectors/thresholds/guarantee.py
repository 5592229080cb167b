"""A threshold with a guarantee of the rate of false alarms, for motion like the calibration's.

The method is split-conformal calibration whose unit is a motion episode. Samples in time are not
exchangeable (a stick-slip lasts, a payload stays). Episodes that are drawn in the same way are
exchangeable: the rank of a new episode's peak among the peaks of n calibration episodes is uniform.
With the (k + 1)-th largest peak as the threshold, the probability p that a fresh episode alarms
follows Beta(k + 1, n - k) whatever the detector and the motion (Vovk 2012), so P(p > alpha) =
P(Binomial(n, alpha) <= k). The threshold uses the largest k for which this is at most 1 -
confidence.

An episode may alarm more than once. The guarantee is about alarms, so alpha is the rate asked for
times the hours of an episode over the alarms of an alarmed episode, counted at a lower threshold
that enough calibration episodes exceed (alarms get fewer as the threshold rises).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tauguard.detectors.thresholds.free_scores import FreeScores

#: Alarms of an alarmed episode are counted at the threshold that this number of episodes exceed, or
#: this fraction of all if that is fewer.
COUNTED, FRACTION = 30, 0.25


@dataclass(frozen=True)
class Guarantee:
    """A calibrated threshold and what it guarantees."""

    threshold: float  #: of the score
    per_hour: float  #: false alarms asked for
    confidence: float  #: probability, over calibration sets, that the guarantee holds
    episodes: int  #: that it was calibrated on
    hours: float  #: of motion in them
    allowed: int  #: calibration episodes that alarm at the threshold, at most
    alarms_an_episode: float  #: of an alarmed one, as counted


def guaranteed_threshold(
    episodes: Sequence[FreeScores], per_hour: float, confidence: float = 0.95
) -> Guarantee:
    """The lowest threshold that guarantees at most ``per_hour`` false alarms on fresh episodes.

    Args:
        episodes: collision-free, drawn as those that the guarantee is for, not trained on.
        per_hour: false alarms per hour to accept, above 0.
        confidence: probability that calibration episodes as good as these give a threshold that
            keeps the guarantee, between 0 and 1.

    Raises:
        ValueError: bad arguments, or too few episodes for the guarantee; says how many would do.
    """
    check_guarantee([e.seconds for e in episodes], per_hour, confidence)
    count = len(episodes)
    hours = sum(e.seconds for e in episodes) / 3600
    peaks = np.sort([e.peak for e in episodes])[::-1]
    several, counted = 0.0, min(COUNTED, int(FRACTION * count))
    # Counted at a threshold that at least as many episodes exceed: alarms of an episode become
    # fewer above it.
    while (now := _alarms_an_episode(episodes, float(peaks[counted]))) > several:
        several = now
        alpha = min(1.0, per_hour * hours / count / several)
        allowed = allowed_episodes(count, alpha, confidence)
        counted = max(counted, allowed)
    if allowed < 0:
        raise _too_few(count, hours, alpha, per_hour, confidence)
    return Guarantee(float(peaks[allowed]), per_hour, confidence, count, hours, allowed, several)


def check_guarantee(seconds: Sequence[float], per_hour: float, confidence: float) -> None:
    """Whether episodes of these lengths can guarantee at all, whatever the detector.

    Each alarm is taken to be in an episode of its own; where one episode alarms more than once,
    :func:`guaranteed_threshold` needs more of them.

    Args:
        seconds: length of each collision-free episode [s].
        per_hour: false alarms per hour to accept, above 0.
        confidence: between 0 and 1.

    Raises:
        ValueError: they cannot, or bad arguments; says how many would do.
    """
    if not per_hour > 0:
        raise ValueError(f"per_hour: {per_hour}, expected above 0")
    if not 0 < confidence < 1:
        raise ValueError(f"confidence: {confidence}, expected between 0 and 1")
    if not seconds:
        raise ValueError("no episodes to calibrate on")
    count, hours = len(seconds), sum(seconds) / 3600
    alpha = min(1.0, per_hour * hours / count)
    if allowed_episodes(count, alpha, confidence) < 0:
        raise _too_few(count, hours, alpha, per_hour, confidence)


def _too_few(
    count: int, hours: float, alpha: float, per_hour: float, confidence: float
) -> ValueError:
    needed = int(np.ceil(np.log(1 - confidence) / np.log1p(-alpha)))
    return ValueError(
        f"{count} episodes ({hours:.2g} h) cannot guarantee {per_hour:g} false alarms per hour "
        f"with confidence {confidence:g}: give {needed} ({hours * needed / count:.2g} h), "
        "or ask for more alarms or less confidence"
    )


def allowed_episodes(count: int, alpha: float, confidence: float) -> int:
    """The largest k with P(Binomial(count, alpha) <= k) <= 1 - confidence; -1 if there is none."""
    from scipy import stats

    k = int(stats.binom.ppf(1 - confidence, count, alpha)) + 1
    while k >= 0 and stats.binom.cdf(k, count, alpha) > 1 - confidence:
        k -= 1
    return k


def _alarms_an_episode(episodes: Sequence[FreeScores], threshold: float) -> float:
    """Alarms of an episode that alarms at ``threshold``; at least 1."""
    counts = [n for e in episodes if (n := e.alarms(threshold)) > 0]
    return max(1.0, float(np.mean(counts))) if counts else 1.0
