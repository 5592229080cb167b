"""The guarantee of a calibrated threshold, against episodes whose true rate is known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from tauguard.detectors import CollisionAlarm, with_guarantee
from tauguard.detectors.thresholds.free_scores import FreeScores
from tauguard.detectors.thresholds.guarantee import allowed_episodes, guaranteed_threshold
from tauguard.traces import Trace


def single(peak, seconds=60.0):
    """An episode with one block up at ``peak``."""
    pieces = np.full(600, -1e9)
    pieces[300] = peak
    return FreeScores(pieces, np.zeros(600), seconds)


@settings(deadline=None, max_examples=25)
@given(st.integers(1, 400), st.floats(1e-3, 0.999), st.floats(0.01, 0.99))
def test_allowed_is_the_largest_that_the_binomial_grants(count, alpha, confidence):
    k = allowed_episodes(count, alpha, confidence)
    if k >= 0:
        assert stats.binom.cdf(k, count, alpha) <= 1 - confidence
    assert k >= -1
    assert stats.binom.cdf(k + 1, count, alpha) > 1 - confidence


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32), st.floats(1, 20), st.floats(1.1, 4))
def test_more_accepted_alarms_or_less_confidence_never_raise_the_threshold(seed, rate, factor):
    rng = np.random.default_rng(seed)
    episodes = [single(p) for p in rng.exponential(size=240)]
    base = guaranteed_threshold(episodes, rate, 0.9).threshold
    assert guaranteed_threshold(episodes, rate * factor, 0.9).threshold <= base
    assert guaranteed_threshold(episodes, rate, 0.5).threshold <= base


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32), st.floats(0.2, 3.0), st.floats(-5, 5))
def test_a_monotone_change_of_the_score_changes_no_alarm(seed, power, shift):
    rng = np.random.default_rng(seed)
    peaks = 1 + rng.exponential(size=200)
    one = guaranteed_threshold([single(p) for p in peaks], 4.0)
    two = guaranteed_threshold([single(p**power + shift) for p in peaks], 4.0)
    up = [p > one.threshold for p in peaks]
    assert up == [p**power + shift > two.threshold for p in peaks]
    assert sum(up) <= one.allowed


def test_the_guarantee_holds_in_as_many_draws_as_it_says():
    rng = np.random.default_rng(5)
    kept, draws = 0, 120
    for _ in range(draws):
        episodes = [single(p) for p in rng.exponential(size=300)]
        found = guaranteed_threshold(episodes, 2.0, 0.9)
        kept += 60 * np.exp(-found.threshold) <= 2.0  # the true rate, 60 episodes an hour
    assert kept / draws >= 0.9 - 3 * np.sqrt(0.9 * 0.1 / draws)
    assert kept / draws <= 0.995  # and not by asking for far too much


def test_alarms_that_come_in_flocks_are_counted_as_such():
    rng = np.random.default_rng(6)

    def flock(peak):
        blocks = np.full(600, -1e9)
        blocks[50:550:100] = peak  # five alarms
        return FreeScores(blocks, np.zeros(600), 60.0)

    peaks = rng.exponential(size=600)
    found = guaranteed_threshold([flock(p) for p in peaks], 5.0, 0.9)
    assert found.alarms_an_episode == 5.0
    assert 60 * 5 * np.exp(-found.threshold) <= 5.0
    alone = guaranteed_threshold([single(p) for p in peaks], 5.0, 0.9)
    assert alone.threshold < found.threshold


def test_alarms_are_merged_as_everywhere():
    blocks = np.zeros(600)
    blocks[[10, 14, 100, 105, 300]] = 1.0
    episode = FreeScores(blocks, np.zeros(600), 60.0)
    assert episode.alarms(0.5) == 4  # 0.4 s apart is one alarm, 0.5 s is two
    assert episode.alarms(1.0) == 0
    assert episode.peak == 1.0


def test_too_little_motion_says_how_much_would_do():
    episodes = [single(p) for p in np.linspace(1, 2, 60)]
    with pytest.raises(ValueError, match=r"60 episodes \(1 h\) cannot .* give 179 \(3 h\)"):
        guaranteed_threshold(episodes, 1.0)
    enough = [single(p) for p in np.linspace(1, 2, 179)]
    assert guaranteed_threshold(enough, 1.0).threshold == 2.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([], 1.0), "no episodes"),
        (([single(1.0)], 0.0), "per_hour: 0.0"),
        (([single(1.0)], float("nan")), "per_hour: nan"),
        (([single(1.0)], 1.0, 1.0), "confidence: 1.0"),
    ],
)
def test_bad_input_is_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        guaranteed_threshold(*arguments)


class Loudness:
    """A detector for the test: the size of the first current."""

    name, settle, dt = "loudness", 0.0, 1e-3

    def scores(self, trace):
        return np.abs(trace.current[:, 0])


def trace_of(current):
    t = np.arange(len(current)) * 1e-3
    table = np.zeros((len(t), 1))
    return Trace(("a",), t, table, table, np.asarray(current)[:, None])


def test_a_detector_is_calibrated_on_traces_with_its_confirmation():
    rng = np.random.default_rng(7)
    traces = []
    for level in rng.exponential(size=40):
        current = np.zeros(2000)
        current[1000:1003] = level  # confirmed
        current[1500:1502] = 50.0  # too short
        traces.append(trace_of(current))
    alarm, found = with_guarantee(CollisionAlarm(Loudness(), 0.0), traces, 900.0, 0.5)
    peaks = sorted((float(np.abs(t.current[1000]).max()) for t in traces), reverse=True)
    assert alarm.threshold == found.threshold == peaks[found.allowed]
    assert found.hours == pytest.approx(40 * 2 / 3600, rel=2e-3)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32), st.floats(20, 2000))
def test_alarms_an_episode_are_counted_where_the_threshold_is(seed, rate):
    rng = np.random.default_rng(seed)
    episodes = [FreeScores(rng.exponential(size=600), np.zeros(600), 60.0) for _ in range(40)]
    found = guaranteed_threshold(episodes, rate)
    counts = [n for e in episodes if (n := e.alarms(found.threshold))]
    assert len(counts) <= found.allowed <= 39
    assert found.alarms_an_episode >= 1
    assert len(counts) * found.alarms_an_episode / found.hours <= rate
