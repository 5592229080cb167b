"""The rate of false alarms that motion allows, against truths that are known."""

import numpy as np
import pytest
from scipy import stats

from tauguard.detectors.thresholds.expected_rate import ExpectedRate
from tauguard.detectors.thresholds.free_scores import FreeScores
from tauguard.detectors.thresholds.tail_model import threshold_for_rate

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
    asked, usual, held = 0.25, [], []
    for _ in range(25):
        known = episodes(lambda r, n: true.rvs(n, random_state=r), rng)
        threshold = threshold_for_rate(known, asked)
        usual.append(HOUR * true.sf(threshold))
        low, high = ExpectedRate.of(known).interval(threshold)
        held.append(low <= usual[-1] <= high)
    assert least * asked < np.mean(usual) < 1.2 * asked
    # Intervals of 95 %: with fewer than 21 of 25, chance is 1 in 100.
    assert sum(held) >= 21


def test_the_interval_holds_the_true_rate_and_falls_with_the_threshold():
    known = episodes(exponential, np.random.default_rng(2))
    rate, before = ExpectedRate.of(known), (0.0, 0.0)
    for asked in (0.25, 20.0, 300.0):
        threshold = threshold_for_rate(known, asked)
        interval = rate.interval(threshold)
        assert interval[0] < HOUR * np.exp(-threshold) < interval[1]
        assert interval[0] >= before[0]
        assert interval[1] > before[1]
        before = interval
    with pytest.raises(ValueError, match="no collision-free motion"):
        ExpectedRate.of([])


def test_no_threshold_promises_less_than_motion_without_an_alarm_can_show():
    rate = ExpectedRate.of(episodes(lambda rng, n: rng.uniform(size=n), np.random.default_rng(3)))
    # The peaks show that the tail ends at 1, and nothing lies beyond; but the motion lasts 45
    # minutes only: exp(-0.75 r) is 0.025.
    for threshold in (1.05, 2.0):
        assert rate.rates(threshold).mean() < 0.25
        assert rate.interval(threshold) == (0.0, pytest.approx(-np.log(0.025) / 0.75))
    assert rate.interval(2.0, 0.6) == (0.0, pytest.approx(-np.log(0.2) / 0.75))


def test_one_noisy_episode_widens_the_interval():
    rng = np.random.default_rng(4)
    known = episodes(exponential, rng)
    noisy = [*known[:-1], *episodes(lambda r, n: 3 * r.exponential(size=n), rng, 1)]
    threshold = threshold_for_rate(noisy, 5.0)
    low, high = ExpectedRate.of(noisy).interval(threshold)
    assert low < 1 < high / 8
    assert high > 2 * ExpectedRate.of(known).interval(threshold)[1]


def test_ties_are_not_alarms():
    flat = [FreeScores(np.full(3000, 2.0), np.ones(3000), 60.0) for _ in range(3)]
    rate = ExpectedRate.of(flat)
    assert not rate.rates(threshold_for_rate(flat, 1.0)).any()
    assert rate.rates(1.9).all()
