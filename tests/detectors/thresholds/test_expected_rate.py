"""The rate of false alarms that motion allows, against truths that are known."""

import numpy as np
import pytest
from scipy import stats

from tauguard.detectors import FreeScores
from tauguard.detectors.thresholds.expected_rate import ExpectedRate
from tauguard.detectors.thresholds.tail_model import tail_level

#: Blocks of an hour, and pieces of a block.
HOUR, PIECES = 7200, 25


def episodes(draw, rng, count=45):
    """``count`` minutes whose blocks' peaks are drawn."""
    return [
        FreeScores(np.repeat(draw(rng, 120), PIECES), np.ones(3000), 60.0) for _ in range(count)
    ]


def exponential(rng, n):
    return rng.exponential(size=n)


@pytest.mark.parametrize(("shape", "least"), [(0.0, 0.0), (0.15, 0.25), (0.25, 0.7)])
def test_thresholds_of_many_calibrations_give_together_the_rate_that_was_asked_for(shape, least):
    true, rng = stats.genpareto(shape), np.random.default_rng(1)
    asked, mean, usual = 0.25, [], []
    for _ in range(25):
        known = episodes(lambda r, n: true.rvs(n, random_state=r), rng)
        rate = ExpectedRate.of(known)
        mean.append(HOUR * true.sf(rate.threshold(asked)))
        peaks = np.sort(np.concatenate([one.blocks()[0] for one in known]))[::-1]
        level = tail_level(peaks, asked * rate.hours, round(0.05 * len(peaks)))
        usual.append(HOUR * true.sf(level))
    assert 0.2 * asked < np.mean(mean) < 2.0 * asked
    # The shape that is usual is not estimated: the rates of the calibrations lie closer together.
    assert least * asked < np.mean(usual) < 1.2 * asked
    assert np.std(usual) < 0.7 * np.std(mean)


def test_the_rate_expected_at_a_threshold_is_the_one_that_it_was_made_for():
    rate = ExpectedRate.of(episodes(exponential, np.random.default_rng(2)))
    for asked in (0.25, 5.0, 100.0):
        threshold = rate.threshold(asked)
        assert rate.mean(threshold) == pytest.approx(asked, rel=0.05)
        assert rate.mean(threshold) <= asked
        low, high = rate.interval(threshold)
        assert low < asked < high
        assert rate.threshold(asked, 0.9) > threshold
    with pytest.raises(ValueError, match="per_hour: 0"):
        rate.threshold(0)
    with pytest.raises(ValueError, match="no collision-free motion"):
        ExpectedRate.of([])


def test_no_threshold_promises_less_than_motion_without_an_alarm_can_show():
    rate = ExpectedRate.of(episodes(lambda rng, n: rng.uniform(size=n), np.random.default_rng(3)))
    assert rate.threshold(0.25) < 1.05  # the peaks show that the tail ends at 1
    # Nothing lies beyond, but the motion lasts 45 minutes only: exp(-0.75 r) is 0.025.
    assert rate.mean(2.0) == 0
    assert rate.interval(2.0) == (0.0, pytest.approx(-np.log(0.025) / 0.75))
    assert rate.episode_bound(2.0, 0.8) == pytest.approx(-np.log(0.2) / 0.75)


def test_one_noisy_episode_widens_the_interval():
    rng = np.random.default_rng(4)
    known = episodes(exponential, rng)
    noisy = [*known[:-1], *episodes(lambda r, n: 3 * r.exponential(size=n), rng, 1)]
    threshold = ExpectedRate.of(noisy).threshold(5.0)
    assert threshold > ExpectedRate.of(known).threshold(5.0)
    low, high = ExpectedRate.of(noisy).interval(threshold)
    assert low < 1 < high / 8


def test_ties_are_not_alarms():
    flat = [FreeScores(np.full(3000, 2.0), np.ones(3000), 60.0) for _ in range(3)]
    rate = ExpectedRate.of(flat)
    assert rate.mean(rate.threshold(1.0)) == 0
    assert rate.threshold(1.0) == pytest.approx(2.0)
