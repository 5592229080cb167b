"""Speed levels: causal, and one rate at every speed where the tails grow with it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from tauguard.detectors.alarms.training import with_rate
from tauguard.detectors.thresholds.expected_rate import ExpectedRate, Tails
from tauguard.detectors.thresholds.free_scores import (
    FreeScores,
    SpeedNormalisation,
    block_maxima,
    recent_speed,
)
from tauguard.detectors.thresholds.tail_model import (
    USUAL_SHAPE,
    Tail,
    tail_level,
    threshold_for_rate,
)
from tauguard.traces import Trace


@given(
    st.lists(st.floats(-5, 5), min_size=1, max_size=80),
    st.floats(0, 0.05),
)
def test_recent_speed_is_the_maximum_of_the_last_moments(speeds, memory):
    dt = 2e-3
    qd = np.column_stack([speeds, np.roll(speeds, 1)])
    total = np.abs(qd).sum(axis=1)
    count = max(1, round(memory / dt))
    expected = [total[max(0, k - count + 1) : k + 1].max() for k in range(len(total))]
    np.testing.assert_array_equal(recent_speed(qd, dt, memory), expected)


def test_one_level_is_passed_as_often_at_every_speed():
    rng = np.random.default_rng(0)
    speed = rng.uniform(0, 10, 40_000)
    peaks = 0.3 + 0.2 * speed + (1 + speed) * rng.exponential(size=len(speed))
    levels = SpeedNormalisation.fit(peaks, speed)
    high = levels(peaks, speed) > 2.0
    counts = [np.sum(high[(speed >= k) & (speed < k + 2)]) for k in range(0, 10, 2)]
    assert max(counts) < 2 * min(counts)
    plain = [np.sum(peaks[(speed >= k) & (speed < k + 2)] > 40) for k in range(0, 10, 2)]
    assert plain[0] == 0 < plain[-1]  # what one threshold on the score itself does


def test_levels_grow_with_the_speed_and_the_normalised_score_with_the_score():
    rng = np.random.default_rng(1)
    levels = SpeedNormalisation.fit(rng.normal(size=3000), rng.uniform(0, 5, 3000))
    assert (np.diff(levels.speed) > 0).all()
    assert (np.diff(levels.base) >= 0).all()
    assert (np.diff(levels.unit) >= 0).all()
    assert (levels.unit > 0).all()
    assert levels(2.0, 3.0) > levels(1.0, 3.0)
    assert levels(2.0, 1e3) == levels(2.0, levels.speed[-1])


def test_a_score_that_never_changes_can_be_normalised():
    levels = SpeedNormalisation.fit(np.full(10, 0.3), np.arange(10.0))
    assert np.isfinite(levels(0.3, 4.0))


@pytest.mark.parametrize(
    ("peaks", "speeds", "says"),
    [
        ([], [], r"shapes \(0,\) and \(0,\)"),
        ([1.0], [1.0, 2.0], r"shapes \(1,\) and \(2,\)"),
        ([np.nan], [1.0], "finite"),
    ],
)
def test_bad_peaks_are_refused(peaks, speeds, says):
    with pytest.raises(ValueError, match=says):
        SpeedNormalisation.fit(peaks, speeds)


def test_a_memory_below_zero_is_refused():
    with pytest.raises(ValueError, match="memory -1"):
        recent_speed(np.zeros((3, 1)), 1e-3, -1)


class Given:
    """A detector whose score is the first joint's current."""

    name, settle, dt = "given", 0.1, 1e-2

    def scores(self, trace):
        return trace.current[:, 0]


def motion(rng, seconds=60.0, dt=1e-2):
    t = np.arange(round(seconds / dt)) * dt
    qd = np.abs(np.sin(t))[:, None] + 0.1
    return Trace(("j",), t, np.zeros_like(qd), qd, qd * rng.exponential(size=qd.shape))


def test_an_alarm_gets_levels_and_a_rate_from_free_motion_and_stays_causal():
    rng = np.random.default_rng(2)
    own = with_rate(Given(), [motion(rng) for _ in range(8)], 60.0)
    assert own.normalisation is not None
    trace = motion(rng)
    whole = own.scores(trace)
    names = ("t", "q", "qd", "current")
    early = replace(trace, **{name: getattr(trace, name)[:2000] for name in names})
    np.testing.assert_array_equal(own.scores(early), whole[:2000])
    with pytest.raises(ValueError, match="no collision-free motion"):
        with_rate(Given(), [], 60.0)


def test_maxima_of_blocks_and_where_they_are():
    high, where = block_maxima(np.array([1.0, 3.0, 2.0, 5.0, 4.0]), 2)
    assert high.tolist() == [3.0, 5.0, 4.0]
    assert where.tolist() == [1, 3, 4]


def test_a_tail_of_too_few_peaks_is_the_largest():
    assert tail_level(np.array([2.0]), 0.5, 10) == 2.0
    assert tail_level(np.array([2.0, 2.0, 2.0, 2.0]), 0.5, 3) == 2.0
    with pytest.raises(ValueError, match="0 allowed"):
        tail_level(np.array([1.0]), 0.0, 1)


def test_a_tail_says_how_many_peaks_to_expect_above_the_level_that_it_gives():
    peaks = np.sort(pareto(np.random.default_rng(3), 5000))[::-1]
    tail = Tail.of(peaks, 100)
    of_many = Tails(*np.array([[tail.base, tail.scale, tail.shape, tail.count]]).T)
    for allowed in (0.1, 1.0, 30.0):
        assert of_many.above(tail.level(allowed)) == pytest.approx(allowed)
    # 0.1 of 5,000 exceed the level with the chance 1 / 50,000.
    assert tail.level(0.1) == pytest.approx((50_000**USUAL_SHAPE - 1) / USUAL_SHAPE, rel=0.25)


@pytest.mark.parametrize("shape", [-0.4, 0.0, 0.2, 0.6])
def test_a_shape_other_than_the_usual_counts_where_peaks_show_it_beyond_chance(shape):
    rng = np.random.default_rng(6)
    few, many = (
        [Tail.of(np.sort(pareto(rng, 20 * n, shape))[::-1], n).shape for _ in range(50)]
        for n in (30, 3000)
    )
    assert np.mean(np.abs(np.array(few) - USUAL_SHAPE) < 0.12) > 0.9
    assert np.mean(many) == pytest.approx(np.clip(shape, -0.5, 0.5), abs=0.1)


def pareto(rng, count, shape=USUAL_SHAPE):
    return stats.genpareto(shape).rvs(count, random_state=rng)


def test_the_rate_of_a_threshold_lies_in_the_interval_that_its_calibration_states():
    rng = np.random.default_rng(5)

    def episodes(count):
        return [FreeScores(pareto(rng, 3000), np.ones(3000), 60.0) for _ in range(count)]

    known = episodes(45)
    threshold = threshold_for_rate(known, 1.0)
    expected = ExpectedRate.of(known)
    low, high = expected.interval(threshold)
    # 7,200 blocks of 25 pieces an hour.
    true = 7200 * 25 * stats.genpareto(USUAL_SHAPE).sf(threshold)
    assert low < true < high
    assert low < 1.0 < high


def test_thresholds_of_slow_logs_allow_for_their_heavier_tail():
    """24 minutes show the shape badly: with that of fast logs too many hard stops are alarms."""
    rng, blocks = np.random.default_rng(2), 24 * 120
    rates = {1 / 23.8: [], 1e-3: []}
    for _ in range(60):
        peaks = np.repeat(pareto(rng, blocks, 0.5), 25)
        for interval, found in rates.items():
            scores = [FreeScores(peaks, np.ones(len(peaks)), blocks / 2, interval=interval)]
            above = stats.genpareto(0.5).sf(threshold_for_rate(scores, 1.0))
            found.append(7200 * above)
    slow, fast = map(np.mean, rates.values())
    assert 0.5 < slow < 1.6 < 2 < fast


@pytest.mark.parametrize("hz", [23.8, 1e3])
def test_scores_know_the_interval_of_their_log(hz):
    t = np.arange(0, 20, 1 / hz)
    still = np.zeros((len(t), 1))
    trace = Trace(("j",), t, still, still, still)
    assert FreeScores.of(np.zeros(len(t)), trace, 1.0).interval == pytest.approx(1 / hz)
