"""Faults that single numbers do not show, each by name."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.datasets import read_log
from tauguard.datasets.log_checks import checked, saturated, unwrapped
from tauguard.traces import Trace, write_mcap


def log(rows=600, dt=0.01, seed=0):
    rng = np.random.default_rng(seed)
    t = np.arange(rows) * dt
    w, phase = np.array([0.7, 1.3, 2.1]), rng.uniform(0, 6, 3)
    arg = t[:, None] * w + phase
    q, qd = 0.8 * np.sin(arg), 0.8 * w * np.cos(arg)
    return Trace(("a", "b", "c"), t, q, qd, 5 * np.sin(1.7 * arg))


def line(row):
    return f"line {row + 1}"


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 99), st.floats(-3, 3), st.sampled_from([-np.pi, 0.0]))
def test_a_wrapped_position_is_continued_and_named(seed, shift, low):
    trace = log(seed=seed)
    moved = trace.q + shift
    wrapped = moved.copy()
    wrapped[:, 1] = np.mod(moved[:, 1] - low, 2 * np.pi) + low
    q, notes = unwrapped(wrapped, trace.joint_names, line)
    jumps = np.flatnonzero(np.abs(np.diff(wrapped[:, 1])) > 3)
    np.testing.assert_array_equal(q[:, [0, 2]], moved[:, [0, 2]])
    np.testing.assert_allclose(np.diff(q[:, 1]), np.diff(moved[:, 1]), atol=1e-12)
    assert [one.where for one in notes] == ([("b",)] if len(jumps) else [])
    assert all(f"line {jumps[0] + 2}: the position of b jumps" in one.text for one in notes)


def test_positions_beyond_a_turn_are_not_wrapped_ones():
    q = np.array([[0.0], [4.0], [10.5], [4.2]])
    assert unwrapped(q, ("a",), line)[1] == []
    np.testing.assert_array_equal(unwrapped(q, ("a",), line)[0], q)


def test_a_good_log_says_nothing():
    assert checked(log(), line) == ()


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**31), jitter=st.floats(0.0, 0.4))
def test_jitter_is_no_fault(seed, jitter):
    trace = log(seed=seed % 100)
    moved = np.random.default_rng(seed).uniform(-jitter, jitter, len(trace.t)) * 0.01
    assert checked(dataclasses.replace(trace, t=trace.t + moved), line) == ()


def test_late_samples_are_told_and_gaps_refused():
    trace = log()
    late = dataclasses.replace(trace, t=trace.t + np.where(np.arange(600) >= 200, 0.02, 0.0))
    (note,) = checked(late, line)
    assert "1 later than twice that, by up to 30 ms; first: line 201" in note.text
    gone = dataclasses.replace(trace, t=trace.t + np.where(np.arange(600) >= 200, 0.5, 0.0))
    cut = r"line 201: .* 0\.51 s .* cut the log there; the rows up to line 200 and those from"
    with pytest.raises(ValueError, match=cut):
        checked(gone, line)


def changed(**scales):
    trace = log()
    return dataclasses.replace(trace, **{k: getattr(trace, k) * v for k, v in scales.items()})


SWAPPED = dataclasses.replace(log(), q=log().q[:, [1, 0, 2]])


@pytest.mark.parametrize(
    ("trace", "message"),
    [
        (changed(q=57.3, qd=57.3), r"line \d+: the velocity of . is .* say `mend=.deg"),
        (changed(q=57.3), r"line \d+: the position of . is .*degrees"),
        (changed(qd=8.0), "units of velocity, position and time do not fit"),
        (changed(t=1000.0), "time in ms"),
        (changed(qd=-1.0), "velocity has the other sign"),
        (SWAPPED, "velocity of a does not follow its position but that of b: columns in another"),
    ],
    ids=["degrees", "degrees of positions", "units", "milliseconds", "sign", "order"],
)
def test_refused(trace, message):
    with pytest.raises(ValueError, match=message):
        checked(trace, line)


def test_slow_velocities_in_degrees():
    slow = changed(q=0.02, qd=0.02 * 57.3)
    with pytest.raises(ValueError, match="velocities in degrees/s, positions in rad"):
        checked(slow, line)


def test_a_saturated_current_is_told_with_its_row():
    trace = log()
    current = trace.current.copy()
    current[300:312, 1] = 25.0
    clipped = dataclasses.replace(trace, current=current)
    assert saturated(clipped) == [("b", 300, 12, 25.0)]
    (note,) = checked(clipped, line)
    assert "line 301: the current of b stays at 25 A for 12 samples" in note.text
    assert saturated(trace) == []


def test_standing_still_is_not_saturation():
    trace = log()
    still = dataclasses.replace(trace, current=np.full_like(trace.current, 2.24))
    assert saturated(still) == []


def test_recordings_of_our_own_pass_the_same_checks(tmp_path):
    trace = log()
    gone = dataclasses.replace(trace, t=trace.t + np.where(np.arange(600) >= 200, 3600.0, 0.0))
    path = tmp_path / "gap.mcap"
    write_mcap(path, gone)
    with pytest.raises(ValueError, match=r"gap\.mcap: sample 200: no sample in the 3\.6e\+03 s"):
        read_log(path)
    write_mcap(path, changed(q=57.3, qd=57.3))
    with pytest.raises(ValueError, match=r"gap\.mcap: sample \d+: the velocity of . is"):
        read_log(path)
    absurd = trace.qd.copy()
    absurd[300, 1] = 1e160
    write_mcap(path, dataclasses.replace(trace, qd=absurd))
    with pytest.raises(ValueError, match=r"sample 300: the velocity of b is 1e\+160"):
        read_log(path)
    write_mcap(path, trace)
    assert read_log(path).findings == ()


def test_a_gap_in_a_labelled_recording_is_no_watched_time(tmp_path):
    from tauguard.datasets.plans import free_episodes
    from tauguard.datasets.recordings import labelled
    from tauguard.envs import simulate

    trace = simulate(free_episodes(0, 1, 2.0, (30.0,), (0.0,), None)[0])
    write_mcap(tmp_path / "whole.mcap", trace)
    assert len(labelled(tmp_path)) == 1
    late = trace.t + np.where(np.arange(len(trace.t)) >= 700, 3600.0, 0.0)
    write_mcap(tmp_path / "gap.mcap", dataclasses.replace(trace, t=late))
    with pytest.raises(ValueError, match=r"gap\.mcap: sample 700: no sample in the 3\.6e\+03 s"):
        labelled(tmp_path)
