"""Output filter, alarms and their matching to collisions."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tauguard.detectors.evaluation.matching import collision_free, match
from tauguard.detectors.events import confirmation_samples, confirmed, find_alarms, undisturbed_rows
from tauguard.traces.trace import Alarm, Collision


def collision(onset, end, kind="strike", peak=20.0):
    return Collision(kind, onset, end, 3, np.zeros(3), np.zeros(3), peak)


@given(st.lists(st.booleans(), max_size=60), st.integers(1, 6))
def test_confirmed_means_the_last_n_are_all_true(raw, n):
    expected = [k + 1 >= n and all(raw[k + 1 - n : k + 1]) for k in range(len(raw))]
    assert confirmed(raw, n).tolist() == expected


@pytest.mark.parametrize(
    ("seconds", "dt", "samples"), [(3e-3, 1e-3, 3), (3e-3, 0.042, 1), (0, 1e-3, 1), (3e-3, 2e-3, 2)]
)
def test_confirmation_is_counted_in_whole_samples(seconds, dt, samples):
    assert confirmation_samples(seconds, dt) == samples


@given(st.lists(st.booleans(), max_size=80), st.integers(0, 8))
def test_alarms_against_a_plain_walk(up, gap):
    t = np.arange(len(up)) * 1.0
    runs = []
    for k, high in enumerate(up):
        if high and runs and k - runs[-1][1] < max(gap, 1.5):
            runs[-1][1] = k
        elif high:
            runs.append([k, k])
    # neighbours are one run whatever the gap; a gap of g means fewer than g seconds between
    assert find_alarms(t, up, max(gap, 1.5)) == tuple(Alarm(float(a), float(b)) for a, b in runs)


def test_alarms_exactly_the_gap_apart_stay_two():
    up = np.array([1, 0, 0, 1, 0, 1], bool)
    t = np.arange(6) * 0.25
    assert find_alarms(t, up) == (Alarm(0.0, 0.0), Alarm(0.75, 0.75), Alarm(1.25, 1.25))
    assert find_alarms(t, up, 0.51) == (Alarm(0.0, 0.0), Alarm(0.75, 1.25))


STRIKE = collision(10.0, 10.1)
CLAMP = collision(20.0, 22.0, "clamp")
SPAN = (0.0, 40.0)


@pytest.mark.parametrize(
    ("alarms", "delays", "false"),
    [
        ([], (None, None), 0),
        ([(10.01, 10.3)], (0.01, None), 0),
        ([(10.0, 10.3)], (0.0, None), 0),
        ([(10.5, 10.6)], (0.5, None), 0),
        ([(10.51, 10.6)], (None, None), 0),  # too late, and a repeat until 1 s after the release
        ([(11.1, 11.2)], (None, None), 0),
        ([(11.11, 11.2)], (None, None), 1),
        ([(9.9, 10.2)], (None, None), 1),  # already up at onset: false and detects nothing
        ([(9.9, 10.1), (10.4, 10.5)], (0.4, None), 1),  # but the next one does
        ([(9.0, 9.4), (10.2, 10.3)], (0.2, None), 1),
        ([(21.9, 22.5)], (None, None), 0),  # too late for a clamp, too
        ([(23.1, 23.5)], (None, None), 1),
        ([(20.1, 20.2), (21.0, 21.1)], (None, 0.1), 0),  # the first one counts
        ([(19.0, 20.5), (21.0, 21.1)], (None, None), 1),
        ([(30.0, 30.1)], (None, None), 1),
    ],
)
def test_matching(alarms, delays, false):
    matching = match([Alarm(*a) for a in alarms], [STRIKE, CLAMP], SPAN)
    assert matching.delays == pytest.approx(delays)
    assert len(matching.false_alarms) == false
    assert matching.free_seconds == pytest.approx(40 - 1.1 - 3.0)


def test_a_clamping_that_lets_go_at_once_can_be_found_like_any_other_collision():
    brief = collision(20.0, 20.005, "clamp")
    matching = match([Alarm(20.007, 20.1)], [brief], SPAN)
    assert matching.delays == pytest.approx((0.007,))
    assert matching.false_alarms == ()
    late = match([Alarm(20.51, 20.6)], [brief], SPAN)
    assert (late.delays, len(late.false_alarms)) == ((None,), 0)


def test_cases_are_equal_pieces_of_collision_free_time():
    false = [Alarm(3.0, 3.1), Alarm(5.9, 6.1)]
    matching = match([*false, Alarm(10.1, 13.0)], [STRIKE, CLAMP], SPAN)
    # 0-10, 11.1-20 and 23-40: five, four and eight pieces of 2 s
    assert matching.cases == 17
    assert matching.false_cases == 3  # one alarm touches two; a true alarm touches none


def test_what_lies_before_the_span_is_left_out():
    matching = match([Alarm(1, 2), Alarm(10.2, 11)], [collision(1, 1.1), STRIKE], (5.0, 40.0))
    assert matching.collisions == (STRIKE,)
    assert not matching.false_alarms
    assert matching.free_seconds == pytest.approx(35 - 1.1)


@given(st.lists(st.tuples(st.floats(0, 50), st.floats(0, 5)), max_size=12))
def test_collision_free_time_is_the_complement(pairs):
    busy = [(a, a + b) for a, b in pairs]
    free = collision_free(busy, (0.0, 40.0))
    grid = np.linspace(0.005, 39.995, 2000)
    inside = np.zeros(2000, bool)
    for low, high in free:
        inside |= (grid > low) & (grid < high)
    taken = np.zeros(2000, bool)
    for low, high in busy:
        taken |= (grid >= low) & (grid <= high)
    assert (inside ^ taken).all()


def test_bad_input():
    with pytest.raises(ValueError, match="expected \\(T,\\) twice"):
        find_alarms(np.zeros(3), np.zeros(4, bool))
    with pytest.raises(ValueError, match="samples: 0"):
        confirmed([True], 0)
    with pytest.raises(ValueError, match="confirmation -1"):
        confirmation_samples(-1, 1e-3)


def recorded(*collisions):
    """Ten seconds at 10 Hz."""
    return SimpleNamespace(t=np.arange(100) * 0.1, truth=SimpleNamespace(collisions=collisions))


def test_what_an_estimator_still_believes_after_a_collision_is_no_free_motion():
    struck, free = recorded(collision(2.0, 2.1), collision(4.0, 4.1)), recorded()
    one, other = undisturbed_rows([struck, free], settle=3.0)
    # A collision occupies half a second, and the estimator settles anew in three.
    assert struck.t[one].tolist() == pytest.approx(np.arange(76, 100) * 0.1)
    assert free.t[other].tolist() == pytest.approx(np.arange(30, 100) * 0.1)


def test_recordings_that_hold_collisions_all_the_time_still_have_free_motion():
    struck = recorded(*(collision(k + 0.1, k + 0.2) for k in range(1, 10, 2)))
    (rows,) = undisturbed_rows([struck], settle=3.0)
    assert rows.any()
    assert not rows[(struck.t > 5.1) & (struck.t < 6.1)].any()
