"""A threshold that keeps a promise: so many false alarms per hour of motion like this, no more.

Split-conformal calibration whose unit is a motion episode. Samples in time are not exchangeable (a
stick-slip lasts, a payload stays), episodes that are drawn alike are: the rank of a fresh episode's
peak among the peaks of n calibration episodes is uniform. With the (k + 1)-th largest peak as the
threshold, the probability p that a fresh episode alarms follows Beta(k + 1, n - k) whatever the
detector and the motion (Vovk 2012), so P(p > alpha) = P(Binomial(n, alpha) <= k). The largest k
that makes this at most 1 - confidence is taken.

An episode may alarm more than once. The promise is about alarms, so alpha is the asked rate times
the hours of an episode over the alarms of an alarmed episode, counted at a lower threshold that
enough calibration episodes pass (alarms get fewer as the threshold rises).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from tauguard.detectors.evaluation.events import MERGE_GAP, find_alarms
from tauguard.detectors.thresholds.rates import block_peaks
from tauguard.detectors.thresholds.thresholded import Thresholded
from tauguard.traces.trace import Trace

Array = NDArray[np.float64]

#: Levels are kept as the peaks of blocks this long [s]: alarms are told apart to within it.
BLOCK = 0.1
#: Alarms an alarmed episode are counted where this many episodes alarm, or this share of them.
COUNTED, SHARE = 30, 0.25


@dataclass(frozen=True, eq=False)
class EpisodeLevels:
    """The levels of one collision-free episode after the detector has settled."""

    blocks: Array  #: peak level of every :data:`BLOCK`, shape (B,)
    seconds: float  #: that were judged

    @classmethod
    def of(cls, watched: Thresholded, trace: Trace) -> EpisodeLevels:
        """Those of ``trace`` under the detector and the confirmation of ``watched``.

        Raises:
            ValueError: the trace has collisions, or is over before the detector has settled.
        """
        if trace.truth is not None and trace.truth.collisions:
            raise ValueError(
                f"an episode with {len(trace.truth.collisions)} collisions: calibration takes "
                "collision-free motion"
            )
        level = watched.levels(trace)
        level = level[level > -np.inf]
        if not len(level):
            raise ValueError(
                f"an episode of {trace.t[-1] - trace.t[0]:g} s: shorter than the "
                f"{watched.detector.settle:g} s that {watched.detector.name} needs to settle"
            )
        dt = trace.dt
        return cls(block_peaks(level, max(1, round(BLOCK / dt))), len(level) * dt)

    @property
    def peak(self) -> float:
        """The highest level: a threshold at or above it does not alarm."""
        return float(self.blocks.max())

    def alarms(self, threshold: float) -> int:
        """How many alarms a threshold gives, those less than the merge gap apart as one."""
        up = self.blocks > threshold
        times = np.arange(len(up)) * (self.seconds / len(up))
        return len(find_alarms(times, up, MERGE_GAP))


@dataclass(frozen=True)
class Promise:
    """A calibrated threshold and what it promises."""

    threshold: float  #: of the score
    per_hour: float  #: false alarms asked for
    confidence: float  #: probability, over calibration sets, that the promise holds
    episodes: int  #: that it was calibrated on
    hours: float  #: that were judged in them
    allowed: int  #: calibration episodes that alarm at the threshold, at most
    alarms_an_episode: float  #: of an alarmed one, as counted


def calibrate_threshold(
    episodes: Sequence[EpisodeLevels], per_hour: float, confidence: float = 0.95
) -> Promise:
    """The lowest threshold that promises at most ``per_hour`` false alarms on fresh episodes.

    Args:
        episodes: collision-free, drawn as those that the promise is for, not trained on.
        per_hour: false alarms per hour to accept, above 0.
        confidence: probability that calibration episodes as good as these give a threshold that
            keeps the promise, between 0 and 1.

    Raises:
        ValueError: bad arguments, or too few episodes for the promise; says how many would do.
    """
    check_promise([e.seconds for e in episodes], per_hour, confidence)
    count = len(episodes)
    hours = sum(e.seconds for e in episodes) / 3600
    peaks = np.sort([e.peak for e in episodes])[::-1]
    several, counted = 0.0, min(COUNTED, int(SHARE * count))
    # Counted where at least as many episodes alarm as will: alarms an episode only grow from there.
    while (now := _alarms_an_episode(episodes, float(peaks[counted]))) > several:
        several = now
        alpha = min(1.0, per_hour * hours / count / several)
        allowed = allowed_episodes(count, alpha, confidence)
        counted = max(counted, allowed)
    if allowed < 0:
        raise _too_few(count, hours, alpha, per_hour, confidence)
    return Promise(float(peaks[allowed]), per_hour, confidence, count, hours, allowed, several)


def check_promise(seconds: Sequence[float], per_hour: float, confidence: float) -> None:
    """Whether episodes of these lengths can promise at all, whatever the detector.

    Each alarm is taken to be in an episode of its own; where one episode alarms more than once,
    :func:`calibrate_threshold` needs more of them.

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
        f"{count} episodes ({hours:.2g} h) cannot promise {per_hour:g} false alarms per hour "
        f"with confidence {confidence:g}: give {needed} ({hours * needed / count:.2g} h), "
        "or ask for more alarms or less confidence"
    )


def allowed_episodes(count: int, alpha: float, confidence: float) -> int:
    """The largest k with P(Binomial(count, alpha) <= k) <= 1 - confidence; -1 if there is none."""
    k = int(stats.binom.ppf(1 - confidence, count, alpha)) + 1
    while k >= 0 and stats.binom.cdf(k, count, alpha) > 1 - confidence:
        k -= 1
    return k


def _alarms_an_episode(episodes: Sequence[EpisodeLevels], threshold: float) -> float:
    """Alarms of an episode that alarms at ``threshold``; at least 1."""
    counts = [n for e in episodes if (n := e.alarms(threshold)) > 0]
    return max(1.0, float(np.mean(counts))) if counts else 1.0


def promised(
    watched: Thresholded, traces: Sequence[Trace], per_hour: float, confidence: float = 0.95
) -> tuple[Thresholded, Promise]:
    """A fitted detector with the threshold that keeps a promise, and the promise.

    Args:
        watched: detector and confirmation; its threshold is replaced.
        traces: collision-free motion episodes that the detector was not trained on.
        per_hour: false alarms per hour to accept.
        confidence: see :func:`calibrate_threshold`.
    """
    episodes = [EpisodeLevels.of(watched, trace) for trace in traces]
    promise = calibrate_threshold(episodes, per_hour, confidence)
    return replace(watched, threshold=promise.threshold), promise
