"""Free, collision or fault: what a trained detector says of streams with faults in them."""

from dataclasses import replace

import numpy as np
import pytest

from tauguard.detectors import CollisionAlarm, Estimator
from tauguard.detectors.alarms.monitor import COLLISION, FAULT, Monitor
from tauguard.detectors.estimation.estimator import MOTION, Unknowns
from tauguard.detectors.estimation.observer import PLAIN_GAIN
from tauguard.envs.gym.sensing import AlarmListener
from tauguard.live.packets import Fault, Packets

#: Faults that the samples show by themselves. Others look like a contact.
SEEN = ("frozen", "stale", "encoder", "missing", "repeated", "rate", "jump", "nan")


@pytest.fixture(scope="module")
def struck(unseen):
    return unseen[1]


@pytest.fixture(scope="module")
def quiet(alarm, struck):
    """A moment in motion, half a second after and 3.2 s before any collision and any alarm."""
    busy = [(a.start, a.end) for a in alarm.detect(struck).alarms]
    busy += [(c.onset, c.end) for c in struck.truth.collisions]
    times = np.arange(struck.t[0] + 4, struck.t[-1] - 4, 0.1)
    near = [
        all(end < t - 0.5 or begin > t + 3.2 for begin, end in busy)
        and np.abs(struck.qd[np.abs(struck.t - t) < 0.1]).max(axis=1).min() > 0.1
        for t in times
    ]
    return float(times[np.flatnonzero(near)[0]])


def part(packets, start, end):
    """The packets that are due in these seconds."""
    return packets.rows(np.flatnonzero((packets.due >= start) & (packets.due < end)))


def answers(alarm, packets):
    monitor = Monitor(alarm, alarm.inputs)
    return [
        monitor.step(float(t), q, qd, i)
        for t, q, qd, i in zip(packets.t, packets.q, packets.qd, packets.current, strict=True)
    ]


def test_without_a_fault_it_says_what_the_detector_says(alarm, struck):
    rows = 12_000
    said = answers(alarm, Packets.of(struck).rows(np.arange(rows)))
    found = alarm.detect(struck)
    assert found.alarm[:rows].any()
    assert [a.alarm for a in said] == found.alarm[:rows].tolist()
    assert np.array([a.score for a in said]).tobytes() == found.score[:rows].tobytes()
    assert not any(a.reason for a in said)


@pytest.mark.parametrize("name", ["nan", "frozen"])
def test_a_block_of_samples_says_what_single_samples_say(alarm, struck, quiet, name):
    start = quiet - struck.t[0]
    packets = part(Fault(name, start, 0.5).apply(Packets.of(struck)), start - 1, start + 1)
    said, arm = answers(alarm, packets), alarm.detector.arm
    made = [Estimator(arm, PLAIN_GAIN, alarm.detector.dt, Unknowns.none()) for _ in range(2)]
    last, single = np.zeros(6), []
    for row in zip(packets.q, packets.qd, packets.current, strict=True):
        out = np.zeros((2 + MOTION, 6))
        if np.isfinite(row).all():
            made[0].step(*row, out)
            last = out[0]
        single.append(last)
    monitor, last = Monitor(alarm, alarm.inputs), np.zeros(6)
    for block in np.array_split(np.arange(len(said)), 97):
        residuals, alarms = np.empty((len(block), 6)), np.empty(len(block), dtype=bool)
        signals = packets.q[block], packets.qd[block], packets.current[block]
        times = packets.t[block].astype(float)
        reason = monitor.steps(times, signals, made[1], last, residuals, alarms)
        assert reason == next((said[k].reason for k in block if said[k].reason), "")
        assert alarms.tolist() == [said[k].alarm for k in block]
        assert residuals.tobytes() == np.array([single[k] for k in block]).tobytes()
    assert any(a.reason for a in said)


def test_outputs_of_another_layout_are_not_written_into_a_copy(alarm, struck):
    signals = [x[:300] for x in (struck.q, struck.qd, struck.current)]
    turned = [np.asfortranarray(x) for x in signals]
    for some in (alarm, replace(alarm, inputs=None)):
        (rows, up), (same, again) = (AlarmListener(some).steps(*x) for x in (signals, turned))
        assert rows.tobytes() == same.tobytes()
        assert np.abs(rows).max() > 0
        assert up.tolist() == again.tolist()
    estimator = Estimator(alarm.detector.arm, PLAIN_GAIN, alarm.detector.dt, Unknowns.none())
    right = np.zeros(6), np.empty((300, 6)), np.empty(300, dtype=bool)
    wrong = np.zeros(12)[::2], np.empty((300, 6), order="F"), np.empty(600, dtype=bool)[::2]
    for k in range(3):
        out = [*right[:k], wrong[k], *right[k + 1 :]]
        with pytest.raises(TypeError):
            Monitor(alarm, alarm.inputs).steps(struck.t[:300], tuple(signals), estimator, *out)


def test_a_listener_makes_one_stream(alarm, monkeypatch):
    made, stream = [], CollisionAlarm.stream
    monkeypatch.setattr(CollisionAlarm, "stream", lambda own: made.append(own) or stream(own))
    for some in (alarm, replace(alarm, inputs=None)):
        AlarmListener(some)
        assert made == [some]
        made.clear()


@pytest.mark.parametrize("name", SEEN)
def test_a_fault_is_seen_within_20_ms_and_costs_no_false_alarm(alarm, struck, quiet, name):
    start = quiet - struck.t[0]
    whole = Fault(name, start, 0.5).apply(Packets.of(struck))
    packets = part(whole, start - 3.5, start + 4)
    said = answers(alarm, packets)
    after = packets.due >= start
    first = next(k for k in np.flatnonzero(after) if said[k].state == FAULT)
    seen = packets.due[first] - (start + 0.5 if name == "missing" else start)
    assert seen <= 20e-3 + 1e-9
    assert not any(a.reason for a, late in zip(said, after, strict=True) if not late)
    # It recovers, and what comes in between is no collision; what came in the milliseconds before
    # the fault could be seen is taken back with it.
    around = np.flatnonzero(after & (packets.due < start + 3))
    intact = [a.start - struck.t[0] for a in alarm.detect(struck).alarms]
    assert not [t for t in intact if start - 0.5 <= t <= start + 3]  # whatever comes is the fault's
    assert not [packets.due[k] for k in around if k >= first and said[k].alarm]
    assert said[-1].state != FAULT


def test_collisions_after_the_recovery_are_found(alarm, struck, quiet):
    start = quiet - struck.t[0]
    packets = Fault("frozen", start, 0.2).apply(Packets.of(struck))
    said = answers(alarm, packets)
    ready = start + 0.2 + alarm.settle
    whole = alarm.detect(struck).alarms
    late = [a for a in whole if a.start - struck.t[0] > ready + 0.5]
    up = np.array([a.alarm for a in said])
    found = [up[(packets.t >= a.start - 0.02) & (packets.t <= a.end + 0.02)].any() for a in late]
    assert len(late) >= 2
    assert np.mean(found) >= 0.75


def test_one_bad_sample_blinds_for_a_window_only(alarm, struck, quiet):
    start = quiet - struck.t[0]
    packets = part(Fault("nan", start, 0.9e-3).apply(Packets.of(struck)), start - 3.5, start + 0.5)
    bad = [k for k, a in enumerate(answers(alarm, packets)) if a.state == FAULT]
    assert 1 <= len(bad) <= 102
    assert packets.due[bad[-1]] - packets.due[bad[0]] <= 0.1 + 1e-9


def test_a_fault_does_not_hide_the_collision_before_it(alarm, struck):
    detection = alarm.detect(struck)

    def lasts(begin):
        """Whether the alarm is up, without a gap, around the moment of the fault."""
        return detection.alarm[np.abs(struck.t - begin - 0.05) < 0.01].all()

    found = next(a for a in detection.alarms if a.end - a.start > 0.06 and lasts(a.start))
    start = found.start - struck.t[0] + 0.05
    packets = part(Fault("nan", start, 0.3).apply(Packets.of(struck)), 0, start + 0.4)
    said = answers(alarm, packets)
    inside = np.flatnonzero((packets.t >= found.start + 0.06) & (packets.t < found.start + 0.3))
    assert {said[k].state for k in inside} == {COLLISION}
    assert all("not-finite" in said[k].reason for k in inside)


def test_a_clock_that_begins_anew_does_not_blind_it(alarm, struck, quiet):
    packets = part(Packets.of(struck), quiet - struck.t[0] - 3.5, quiet - struck.t[0] + 4)
    begin = int(np.searchsorted(packets.t, quiet))
    t = packets.t.copy()
    t[begin:] -= t[begin]
    said = answers(alarm, Packets(packets.due, t, packets.q, packets.qd, packets.current))
    assert said[begin].state == FAULT
    assert said[-1].state != FAULT


def test_up_to_20_ms_of_missing_packets_are_interpolated(alarm, struck, quiet):
    start = quiet - struck.t[0]
    for count in (1, 2):
        packets = Fault("missing", start, (count - 0.5) * struck.dt).apply(Packets.of(struck))
        said = answers(alarm, part(packets, start - 3.5, start + 0.5))
        assert len(packets.t) == len(struck.t) - count
        assert not any(a.reason for a in said)


#: Not told from a contact: what it is answered with instead, at least once while it lasts.
LIKE_A_CONTACT = ("bias", "swapped")


@pytest.mark.parametrize("name", LIKE_A_CONTACT)
def test_a_large_error_of_the_currents_is_not_silent(alarm, struck, quiet, name):
    start = quiet - struck.t[0]
    packets = Fault(name, start, 1.0).apply(Packets.of(struck))
    said = answers(alarm, part(packets, start - 3.5, start + 1.0))
    assert any(a.state == COLLISION or a.reason for a in said[-1000:])


def test_a_bias_below_the_noise_of_the_residual_is_not_seen(alarm, struck, quiet):
    # Nothing differs but by less than what collision-free motion shows.
    start = quiet - struck.t[0]
    packets = Packets.of(struck)
    current = packets.current.copy()
    smallest = 0.2 * np.asarray(alarm.detector.arm.noise) / np.abs(alarm.detector.arm.drive_gain)
    current[packets.due >= start] += smallest
    shifted = replace(packets, current=current)
    said = answers(alarm, part(shifted, start - 3.5, start + 1.0))
    assert not any(a.alarm or a.reason for a in said)
