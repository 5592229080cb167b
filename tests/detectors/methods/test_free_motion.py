"""A detector that never saw a collision: quiet on fresh motion and dwells, awake to contacts."""

import dataclasses

import numpy as np
import pytest

from tauguard.benchmarks.real_arm import study as real_arm
from tauguard.detectors import ArmModel
from tauguard.detectors.evaluation.semi_real import Added, add_contact, moments, smallest_found
from tauguard.detectors.methods.free_motion import (
    RELEASE,
    FreeMotionDetector,
    FreeMotionSettings,
    delayed,
    median_of,
    resting,
    without_kicks,
)
from tauguard.detectors.methods.free_motion_file import load_free_motion, save_free_motion
from tests.detectors.synthetic_arm import GAIN, held_joint, nominal, record


@pytest.fixture(scope="module")
def detector():
    logs = [record(seed) for seed in range(4)]
    return FreeMotionDetector().fit(logs, ArmModel(nominal(), GAIN))


@pytest.fixture(scope="module")
def fresh():
    return record(11, seconds=20.0)


def test_quiet_on_motion_it_has_not_seen(detector, fresh):
    assert not detector.detect(fresh).alarms
    assert not detector.detect(record(12, load=2.0)).alarms
    assert detector.seconds == pytest.approx(4 * 21.0, abs=0.5)


def test_finds_added_contacts_and_small_ones_not(detector, fresh):
    start = float(fresh.t[0] + 13.0)
    for joint in range(3):
        torque = np.zeros(3)
        torque[joint] = 40.0
        struck = add_contact(fresh, GAIN, Added(start, 0.1, tuple(torque)))
        alarms = detector.detect(struck).alarms
        assert [a for a in alarms if start <= a.start <= start + 0.3], joint
        tiny = add_contact(fresh, GAIN, Added(start, 0.1, tuple(1e-3 * torque)))
        assert not detector.detect(tiny).alarms


def test_smallest_found_is_a_threshold(detector, fresh):
    starts = moments(~detector.rests(fresh)[:, 1], fresh.t, 3, 0)
    found = smallest_found(lambda t: detector.detect(t).alarm, fresh, GAIN, 1, starts)
    assert (np.isfinite(found) & (found < 60)).all()
    for k, (start, peak) in enumerate(zip(starts, found, strict=True)):
        sign = 1 if k % 2 == 0 else -1
        for factor, expected in ((1.001, True), (0.9, False)):
            contact = Added(start, 0.1, (0.0, sign * factor * peak, 0.0))
            alarm = detector.detect(add_contact(fresh, GAIN, contact)).alarm
            rows = (fresh.t >= start) & (fresh.t <= start + 0.5)
            assert bool(alarm[rows].any()) is expected


def test_joints_that_are_loaded_together_count_together(detector, fresh):
    """Two thirds of what is found on each joint alone are found on all of them at once."""
    start = float(fresh.t[0] + 13.0)
    alone = [
        smallest_found(lambda t: detector.detect(t).alarm, fresh, GAIN, joint, [start])[0]
        for joint in range(3)
    ]
    for share, expected in ((2 / 3, True), (0.2, False)):
        torque = tuple(share * np.array(alone))
        struck = add_contact(fresh, GAIN, Added(start, 0.1, torque))
        assert bool(detector.detect(struck).alarms) is expected
    score = np.linalg.norm(detector.ratios(fresh), axis=1)
    np.testing.assert_allclose(detector.scores(fresh), score, rtol=1e-12)


def test_a_regime_that_no_log_shows_has_the_bounds_of_the_other():
    """A joint that never stops, or never starts, leaves no gap in which nothing is an alarm."""
    arm = ArmModel(nominal(), GAIN)
    restless = FreeMotionDetector().fit([record(s, dwell=(-2, -1)) for s in range(4)], arm)
    dwelling = record(11, seconds=20.0)
    assert not restless.detect(dwelling).alarms
    hit = add_contact(dwelling, GAIN, Added(9.0, 0.1, (0.0, 40.0, 0.0)))
    assert restless.rests(dwelling)[890:900].all()
    assert [a for a in restless.detect(hit).alarms if 9 <= a.start <= 9.3]

    one_holds = FreeMotionDetector().fit([held_joint(s) for s in range(4)], arm)
    np.testing.assert_array_equal(one_holds.moving.weights[2], one_holds.resting.weights[2])
    trace = held_joint(11)
    assert not one_holds.detect(trace).alarms
    hit = add_contact(trace, GAIN, Added(13.0, 0.1, (0.0, 40.0, 0.0)))
    assert [a for a in one_holds.detect(hit).alarms if 13 <= a.start <= 13.3]
    assert np.isfinite(one_holds.scores(dwelling)).all()


def test_one_sample_kick_of_the_controller_is_no_contact(detector, fresh):
    row = 1400
    current = fresh.current.copy()
    current[row] += 20.0
    assert not detector.detect(dataclasses.replace(fresh, current=current)).alarms
    current[row : row + 12] += 8.0
    assert detector.detect(dataclasses.replace(fresh, current=current)).alarms


def test_causal(detector, fresh):
    """What comes later changes nothing before."""
    cut = 1500
    shorter = dataclasses.replace(
        fresh, t=fresh.t[:cut], q=fresh.q[:cut], qd=fresh.qd[:cut], current=fresh.current[:cut]
    )
    np.testing.assert_array_equal(detector.scores(shorter), detector.scores(fresh)[:cut])


def test_at_rest_until_it_has_travelled():
    q = np.concatenate([np.zeros(50), np.linspace(0, 0.8 * RELEASE, 50), np.linspace(0.1, 1, 50)])
    qd = np.concatenate([np.zeros(50), np.full(50, 0.05), np.full(50, 0.5)])
    rest = resting(q[:, None], qd[:, None], 0.01)[:, 0]
    assert rest[:100].all()
    assert not rest[100:].any()


def test_median_takes_the_sample_before():
    x = np.array([[0.0], [1], [9], [3], [4], [5]])
    np.testing.assert_array_equal(delayed(x)[:, 0], [0, 0, 1, 9, 3, 4])
    np.testing.assert_array_equal(median_of(3, x)[2:, 0], [1, 3, 4, 4])


def test_a_kick_of_two_samples_goes_and_a_blow_stays():
    x = np.zeros((40, 1))
    x[10:12] = 50.0
    np.testing.assert_array_equal(without_kicks(x, np.array([5.0])), 0.0)
    x[20:30] = 50.0
    seen = without_kicks(x, np.array([5.0]))[:, 0]
    assert np.flatnonzero(seen).min() == 22
    assert (seen[22:30] == 50).all()
    assert (seen[:20] == 0).all()


def test_file_and_back(tmp_path, detector, fresh):
    save_free_motion(detector, tmp_path / "model.json")
    again = load_free_motion(tmp_path / "model.json")
    np.testing.assert_array_equal(again.scores(fresh), detector.scores(fresh))
    text = (tmp_path / "model.json").read_text()
    for bad, message in (
        (text[: len(text) // 2], "damaged"),
        (
            text.replace("free-motion detector 2", "free-motion detector 1"),
            "version.*anew by .tauguard train --free",
        ),
        (text.replace('"moving"', '"gone"'), "a part missing"),
    ):
        (tmp_path / "bad.json").write_text(bad)
        with pytest.raises(ValueError, match=message):
            load_free_motion(tmp_path / "bad.json")
    with pytest.raises(ValueError, match="cannot be read"):
        load_free_motion(tmp_path / "none.json")


def test_more_alarms_accepted_means_a_lower_bound():
    logs = [record(seed) for seed in range(3)]
    few, many = (
        FreeMotionDetector(FreeMotionSettings(false_alarms_per_hour=rate)).fit(
            logs, ArmModel(nominal(), GAIN)
        )
        for rate in (0.1, 100.0)
    )
    # The constant terms may both be at their floor.
    assert (many.moving.weights <= few.moving.weights + 1e-12).all()
    assert (many.moving.weights.sum(axis=1) < few.moving.weights.sum(axis=1)).all()


@pytest.mark.parametrize("rate", [80, 125, 250, 500, 1000])
def test_logs_at_other_rates(detector, rate):
    """The same motion and blow at another rate: found as soon, and nothing else is."""
    fresh = record(15, seconds=14.0, dt=1 / rate)
    assert not detector.detect(fresh).alarms
    struck = add_contact(fresh, GAIN, Added(12.0, 0.1, (0.0, 20.0, 0.0)))
    detection = detector.detect(struck)
    (alarm,) = detection.alarms
    assert 12.0 < alarm.start < 12.15
    assert len(detection.score) == len(struck.t)


@pytest.mark.parametrize("start", [3.1, 4.7, 6.2])
def test_a_log_that_begins_in_motion(detector, fresh, start):
    later = fresh.t > start
    cut = dataclasses.replace(
        fresh, t=fresh.t[later], q=fresh.q[later], qd=fresh.qd[later], current=fresh.current[later]
    )
    assert np.abs(cut.qd[0]).max() > 0.1
    assert not detector.detect(cut).alarms


def test_training_logs_of_two_rates():
    logs = [record(0), record(1), record(2, dt=0.002)]
    mixed = FreeMotionDetector().fit(logs, ArmModel(nominal(), GAIN))
    assert mixed.dt == pytest.approx(0.01)
    assert not mixed.detect(record(11, seconds=14.0)).alarms


def test_what_it_refuses(detector, fresh):
    with pytest.raises(ValueError, match="2 logs: give three"):
        FreeMotionDetector().fit([fresh, fresh], ArmModel(nominal(), GAIN))
    with pytest.raises(ValueError, match="not fitted"):
        FreeMotionDetector().scores(fresh)
    slow = dataclasses.replace(fresh, t=2 * fresh.t)
    with pytest.raises(ValueError, match="record at 100 Hz or faster"):
        detector.scores(slow)
    with pytest.raises(ValueError, match="expected blow or push"):
        add_contact(fresh, GAIN, Added(1.0, 0.1, (1.0, 0.0, 0.0), "kick"))


@pytest.mark.data
def test_a_log_that_begins_at_rest_does_not_blind_the_detector(data_dir, monkeypatch):
    # Its first seconds tell mass and moment of a load badly; the tracker has to forget that later.
    monkeypatch.setenv("TAUGUARD_DATA", str(data_dir))
    if real_arm.available() is None:
        pytest.skip("no ur10e folder in the real data")
    data = real_arm.load(real_arm.available())
    names = ["ur-20_01_31-unload", "ur-20_02_10-30sec_12harm", "ur-20_02_12-40sec_12harm"]
    detector = FreeMotionDetector().fit([data.moving[name] for name in names], data.arm)
    assert (detector.moving.weights[:, 0] < [8, 10, 7, 2, 2, 2]).all()
