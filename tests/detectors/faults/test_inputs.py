"""Faults that samples show by themselves: each is named at once, and free motion has none."""

import re
from dataclasses import replace

import numpy as np
import pytest

from tauguard.detectors.faults.inputs import FaultCheck, UsualInput
from tauguard.traces.trace import Trace

NAMES = ("shoulder", "elbow", "wrist")


def motion(seed, seconds=4.0, rate=500.0, noise=1e-5):
    """Three joints in motion whose velocity is the derivative of their position, with noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, seconds, 1 / rate)
    w, phase = rng.uniform(0.5, 3, 3), rng.uniform(0, 6, 3)
    q = np.sin(w * t[:, None] + phase) + noise * rng.standard_normal((len(t), 3))
    qd = w * np.cos(w * t[:, None] + phase) + 100 * noise * rng.standard_normal((len(t), 3))
    current = 3 * np.sin(1.3 * w * t[:, None]) + 0.02 * rng.standard_normal((len(t), 3))
    return Trace(NAMES, t, q, qd, current)


@pytest.fixture(scope="module")
def usual():
    return UsualInput.of([motion(seed) for seed in range(3)])


def said(usual, trace, change=None, begin=1000):
    """What is said of each sample; ``change`` alters arrays t, q, qd, current from ``begin`` on."""
    arrays = [np.array(x) for x in (trace.t, trace.q, trace.qd, trace.current)]
    if change:
        change(*(x[begin:] for x in arrays))
    check = FaultCheck(usual)
    return [check.step(float(t), q, qd, i) for t, q, qd, i in zip(*arrays, strict=True)]


@pytest.mark.parametrize("seed", range(10, 20))
def test_other_free_motion_shows_no_fault(usual, seed):
    assert set(said(usual, motion(seed))) == {None}


def nan_current(t, q, qd, current):
    current[0, 1] = np.nan


def huge_velocity(t, q, qd, current):
    qd[0, 2] = 1e100


def huge_position(t, q, qd, current):
    q[0, 0] = 1e160


def huge_current(t, q, qd, current):
    current[0, 0] = 60.0


def same_time(t, q, qd, current):
    t[0] = t[0] - 1 / 500


def back_in_time(t, q, qd, current):
    t[0] -= 1.0


def gap(t, q, qd, current):
    t += 1.0


def jump(t, q, qd, current):
    q[:, 1] += 0.2


def frozen(t, q, qd, current):
    q[:], qd[:], current[:] = q[0], qd[0], current[0]


def encoder(t, q, qd, current):
    q[:, 1] = q[0, 1]


def reversed_velocity(t, q, qd, current):
    qd[:, 0] *= -1


def stuck_current(t, q, qd, current):
    current[:, 2] = 2.5


#: The change, the name of the fault, and samples after which it has to be said.
CASES = [
    (nan_current, "not-finite: the current or torque of elbow", 1),
    (huge_velocity, "range: the velocity of wrist", 1),
    (huge_position, "position: the position of shoulder", 1),
    (huge_current, "range: the current or torque of shoulder", 1),
    (same_time, "time: the time stamp repeats", 1),
    (back_in_time, "time: the time goes back by 0.998 s", 1),
    (gap, "gap: nothing for 1e\\+03 ms", 1),
    (jump, "position: the position of elbow", 1),
    (frozen, "(frozen: no signal has changed|position: )", 10),
    (encoder, "position: the position of elbow", 10),
    (reversed_velocity, "position: the position of shoulder", 10),
    (stuck_current, "stuck: the current or torque of wrist stays at 2.5", 10),
]


@pytest.mark.parametrize(("change", "text", "within"), CASES, ids=[c[0].__name__ for c in CASES])
def test_a_fault_is_named_within_20_ms(usual, change, text, within):
    found = said(usual, motion(42), change)
    assert set(found[:1000]) == {None}
    first = next(k for k, fault in enumerate(found) if fault)
    assert first < 1000 + within
    assert re.match(text, found[first])


def test_a_bus_that_stands_still_with_the_arm_is_frozen(usual):
    standing = motion(42)
    standing.q[:], standing.qd[:] = standing.q[0], 0.0
    found = said(usual, standing, frozen)
    assert set(found[:1000]) == {None}
    assert found[1000 + usual.repeats + 1].startswith("frozen: no signal has changed")


def test_an_encoder_that_freezes_at_rest_is_not_seen_until_its_joint_moves(usual):
    trace = motion(42)
    still = np.arange(len(trace.t)) < 1500
    trace.q[still, 1], trace.qd[still, 1] = trace.q[1500, 1], 0.0
    found = said(usual, trace, encoder)
    assert set(found[:1500]) == {None}
    first = next(k for k, fault in enumerate(found) if fault)
    assert 1500 <= first < 1520
    assert found[first].startswith("position: the position of elbow")


def test_another_rate_is_named_within_20_samples(usual):
    found = said(usual, motion(42, rate=250.0))
    first = next(k for k, fault in enumerate(found) if fault)
    assert first < 20
    assert found[first] == "rate: samples come every 4 ms, trained at 2 ms"


def test_one_bad_sample_is_one_fault(usual):
    for change in (nan_current, huge_velocity, huge_current, same_time):
        found = said(usual, motion(42), change)
        assert sum(fault is not None for fault in found) == 1


def test_a_clock_that_begins_anew_is_one_fault(usual):
    def restart(t, q, qd, current):
        t -= t[0]

    found = said(usual, motion(42), restart)
    assert [k for k, fault in enumerate(found) if fault] == [1000]


def test_a_jump_and_back_costs_two_windows_at_most(usual):
    def one_sample(t, q, qd, current):
        q[0, 1] += 0.2

    bad = [k for k, fault in enumerate(said(usual, motion(42), one_sample)) if fault]
    assert bad[0] == 1000
    assert bad[-1] <= 1000 + usual.window + 1


def test_the_sums_do_not_drift():
    # Ten minutes of one motion: what is summed stays what a sum of its own would be.
    long = motion(5, seconds=120.0)
    assert set(said(UsualInput.of([long]), long)) == {None}


def test_nothing_to_learn_from_is_said():
    with pytest.raises(ValueError, match="nothing to learn from"):
        UsualInput.of([])


def test_other_joints_are_refused(usual):
    with pytest.raises(ValueError, match="one entry per joint"):
        FaultCheck(usual).step(0.0, np.zeros(2), np.zeros(3), np.zeros(3))


def test_a_hard_contact_on_a_joint_that_needs_little_is_no_fault():
    """A first joint about a vertical axis gives 2 N m in free motion; a push asks for 20."""
    free = motion(0)
    quiet = replace(free, current=free.current * [0.1, 1.0, 1.0])

    def pushed(t, q, qd, current):
        current[:500, 0] += np.sin(np.arange(500) / 500 * np.pi) * 6.0

    assert not any(said(UsualInput.of([quiet]), quiet, pushed))


def test_positions_are_not_compared_with_their_own_derivative():
    """A jerk moves the position away from the last velocities: no fault if these are derived."""

    def jerk(t, q, qd, current):
        q[:3, 1] += np.array([1, 2, 1]) * 2e-3

    free = motion(0)
    assert any("off its velocity" in (x or "") for x in said(UsualInput.of([free]), free, jerk))
    derived = replace(free, meta={"velocities": "differentiated"})
    assert not any(said(UsualInput.of([free, derived]), derived, jerk))
