"""The rule of counting against plain loops on a grid, and its result by chance."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.detectors.evaluation.matching import ONSET_ERROR, Contact, count, merged
from tauguard.traces import Alarm

#: Times are multiples of 1/20 s, so that onset errors and windows fall between them or on them.
TICKS = st.integers(0, 400)


@st.composite
def logs(draw):
    times = sorted(draw(st.sets(TICKS, max_size=10)))
    truth = draw(st.sampled_from(sorted(ONSET_ERROR)))
    ends = [
        min(a + draw(st.integers(0, 30)), b)
        for a, b in zip(times, [*times[1:], 400][: len(times)], strict=True)
    ]
    contacts = [Contact(a / 20, b / 20, truth) for a, b in zip(times, ends, strict=True)]
    ups = draw(st.lists(st.tuples(TICKS, st.integers(0, 40)), max_size=12))
    # Alarms start a little off the grid: whether a window's ends belong to it does not matter.
    return contacts, [Alarm(a / 20 + 0.007, (a + b) / 20 + 0.007) for a, b in ups]


def plainly(contacts, alarms, begin, end):
    """The rule of the manual, contact by contact and alarm by alarm."""
    groups = []
    for alarm in sorted(alarms, key=lambda a: a.start):
        if groups and alarm.start - groups[-1][1] < 0.2:
            groups[-1][1] = max(groups[-1][1], alarm.end)
        else:
            groups.append([alarm.start, alarm.end])
    error = {c.onset: ONSET_ERROR[c.truth] for c in contacts}
    found, up, near, finders = [], [], set(), set()
    for k, contact in enumerate(contacts):
        opens, closes = contact.onset - error[contact.onset], contact.onset + 0.5
        if k + 1 < len(contacts):
            closes = min(closes, contacts[k + 1].onset - error[contacts[k + 1].onset])
        release = max(contact.end + 1.0, contact.onset + 0.5)
        near |= {j for j, (a, _) in enumerate(groups) if opens <= a <= release}
        if not begin <= opens <= end:
            continue
        inside = [a for a, _ in groups if opens <= a < closes and begin <= a <= end]
        found.append(inside[0] - contact.onset if inside else np.inf)
        finders |= {inside[0]} if inside else set()
        up.append(not inside and any(a < opens <= b for a, b in groups))
    counted = [(j, a) for j, (a, _) in enumerate(groups) if begin <= a <= end]
    false = [a for j, a in counted if j not in near]
    return found, up, false, [a for j, a in counted if j in near and a not in finders]


@given(logs(), st.sampled_from([0.0, 2.003]))
def test_the_rule_against_plain_loops(log, begin):
    contacts, alarms = log
    counted = count(alarms, contacts, (begin, 20.0))
    found, up, false, repeats = plainly(contacts, alarms, begin, 20.0)
    assert list(counted.delays) == pytest.approx(found)
    assert list(counted.still_up) == up
    assert [a.start for a in counted.false_alarms] == false
    assert [a.start for a in counted.repeats] == repeats


@given(logs(), st.integers(0, 399))
def test_an_alarm_is_false_exactly_in_the_time_that_counts(log, tick):
    contacts, start = log[0], tick / 20 + 0.007
    one = count([Alarm(start, start)], contacts, (0.0, 20.0))
    assert bool(one.false_alarms) == any(a < start < b for a, b in one.free)
    assert 0 <= one.free_seconds <= 20.0


@settings(max_examples=20, deadline=None)
@given(logs())
def test_the_result_by_chance_is_the_mean_over_all_shifts(log):
    """Of 200 shifts the first is none, so that every contact found by it counts."""
    contacts, alarms = log
    counted = count(alarms, contacts, (0.0, 20.0))
    by_hand = np.zeros(len(counted.contacts))
    for k in range(200):
        moved = [
            Alarm((a.start + 0.1 * k) % 20.0, (a.start + 0.1 * k) % 20.0) for a in merged(alarms)
            if a.start <= 20.0
        ]  # fmt: skip
        starts = sorted(a.start for a in moved)
        for j, one in enumerate(counted.contacts):
            later = [c.opens for c in contacts if c.onset > one.onset]
            last = min([one.onset + 0.5, *later])
            by_hand[j] += any(one.opens <= s < last for s in starts)
    # A shifted start on a window's edge may fall on either side by rounding.
    assert np.abs(np.array(counted.by_chance) - by_hand / 200).max(initial=0) <= 0.011 * len(alarms)


@pytest.mark.parametrize("period", [0.5, 0.7, 1.3, 2.9])
def test_a_detector_that_knows_nothing_finds_what_chance_finds(period):
    """Alarms of 40 ms at a fixed period, on contacts at random times."""
    rng = np.random.default_rng(7)
    onsets = np.cumsum(rng.uniform(0.4, 4.0, 300))
    contacts = [Contact(float(t), float(t) + 0.2, "switch") for t in onsets]
    end = float(onsets[-1]) + 5.0
    alarms = [Alarm(float(t), float(t) + 0.04) for t in np.arange(0.0, end, period)]
    counted = count(alarms, contacts, (0.0, end))
    found = np.isfinite(counted.delays).mean()
    expected = np.mean(counted.by_chance)
    error = np.sqrt(expected * (1 - expected) / 300)
    assert abs(found - expected) <= 3 * error + 1e-9
    assert expected == pytest.approx(min(1.0, 0.55 / period), abs=0.06)


def test_a_contact_has_times_in_order_and_a_known_truth():
    with pytest.raises(ValueError, match=r"onset 2.0 s after its end 1.0 s"):
        Contact(2.0, 1.0)
    with pytest.raises(ValueError, match="truth 'guess': one of simulation, switch"):
        Contact(1.0, 2.0, "guess")
    with pytest.raises(ValueError, match="expected begin <= end"):
        count([], [], (2.0, 1.0))
