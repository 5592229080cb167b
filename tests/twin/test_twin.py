"""A twin of an arm whose friction is known finds that friction, and is like its arm."""

from dataclasses import replace

import numpy as np
import pytest

from tauguard.detectors import ArmModel, FrictionModel, observe
from tauguard.detectors.dynamics.robot import RobotNumbers
from tauguard.models import Friction, load_arm
from tauguard.twin import compare, fit_twin, with_intervals
from tauguard.twin.description import write_twin
from tauguard.twin.drive_fit import fit_friction
from tauguard.twin.identify import USUAL, left_over, turned
from tauguard.twin.judge import Track, classifier_areas
from tauguard.twin.play import friction_torque, modelled
from tauguard.twin.signals import Motion, bridged_stop, motion_of, quantum, without_gaps
from tests.detectors.synthetic_arm import (
    COULOMB,
    GAIN,
    VISCOUS,
    XML,
    held_joint,
    record,
    true_model,
)


@pytest.fixture(scope="module")
def arm():
    friction = FrictionModel.coulomb_viscous(COULOMB, VISCOUS)
    robot = RobotNumbers.from_pin(true_model())
    return ArmModel(robot, GAIN, friction, np.full(3, 0.1))


@pytest.fixture(scope="module")
def logs():
    return [record(seed) for seed in (1, 2, 3)]


@pytest.fixture(scope="module")
def twin(arm, logs):
    return fit_twin(arm, logs[:2], np.full(3, 30.0))


def test_friction_of_a_known_arm_is_found(twin):
    # At .3 rad/s, in the middle of the logged speeds: parts that are alike there may be exchanged.
    speed = 0.3
    f = twin.drive.friction
    slip = np.exp(-((speed / f.stribeck_velocity) ** 2))
    rises = (f.slope * np.tanh(speed / f.slope_velocity)).sum(axis=1)
    level = f.coulomb + (f.static - f.coulomb) * slip + rises + f.viscous * speed
    np.testing.assert_allclose(level, COULOMB + VISCOUS * speed, rtol=0.1)
    assert twin.drive.sensors.rate == pytest.approx(100)
    assert twin.notes == ()


def test_the_twin_is_more_like_its_arm_than_one_without_friction(arm, logs, twin):
    found = compare(arm, twin.drive, logs[2:], own=logs[:2])
    assert found.moving_auc[0] < 0.9
    # The arm itself errs alike in all its logs, but not in one with more noise.
    assert found.programs_auc[0] < 0.8
    assert compare(arm, twin.drive, [record(2, noise=0.05)], own=logs[:2]).programs_auc[0] > 0.95
    # Without friction the estimator is left with all of it.
    wrong = compare(arm, replace(twin.drive, friction=None, sensors=None), logs[2:])
    assert (wrong.rms > 4 * found.rms).all()
    assert min(wrong.moving_auc) > 0.95


def test_a_joint_that_never_moves_keeps_a_prior_and_is_named(arm):
    found = fit_twin(arm, [held_joint(1), held_joint(2)], np.full(3, 30.0))
    assert found.fits[2] is None
    assert found.notes[0].startswith("c: hardly moves")
    assert found.drive.friction.coulomb[2] > 0


def test_logs_without_motion_are_refused(arm, logs):
    still = replace(logs[0], qd=0 * logs[0].qd)
    with pytest.raises(ValueError, match="no joint moves"):
        fit_twin(arm, [still], np.full(3, 30.0))


def test_the_description_is_the_robot_that_is_simulated(twin, tmp_path):
    robot = tmp_path / "arm.xml"
    robot.write_text(XML)
    write_twin(twin, robot, tmp_path / "twin.toml", ["a.csv"], "gains")
    drive = load_arm(str(tmp_path / "twin.toml")).facts.drive
    for name in ("coulomb", "static", "viscous", "load"):
        got, given = (getattr(d.friction, name) for d in (drive, twin.drive))
        np.testing.assert_allclose(got, given, rtol=1e-5)
    sensors, given = drive.sensors, twin.drive.sensors
    np.testing.assert_allclose(sensors.left_over.current, given.left_over.current, rtol=1e-4)
    assert sensors.rate == pytest.approx(given.rate)
    with pytest.raises(ValueError, match=r"ends in \.toml"):
        write_twin(twin, robot, tmp_path / "twin.xml", ["a.csv"], "gains")


def test_friction_settles_at_its_level_and_stays_when_the_joint_stops():
    one = np.ones(1)
    friction = Friction(2 * one, 2 * one, 0.1 * one, 3 * one, 2000 * one, 0 * one)
    qd = np.where(np.arange(400) < 200, 0.5, 0.0)[:, None]
    torque = friction_torque(friction, qd, 0 * qd, np.full(400, 0.01))
    assert torque[199, 0] == pytest.approx(2 + 3 * 0.5)
    assert torque[-1, 0] == pytest.approx(2)


def test_the_left_over_has_the_impulse_of_the_logs_error_at_uneven_samples(arm, logs, twin):
    # A late sample and the early one after it have errors of either sign whose impulse is nothing.
    rng = np.random.default_rng(3)
    keep = rng.random(len(logs[0].t)) > 0.02  # lost samples
    t = (logs[0].t + 0.003 * rng.uniform(-1, 1, len(logs[0].t)))[keep]
    whole = logs[0]
    log = replace(whole, t=t, q=whole.q[keep], qd=whole.qd[keep], current=whole.current[keep])
    error = rng.normal(size=log.q.shape)
    model = modelled(arm, twin.drive.friction, twin.drive.gain, log)
    found = left_over(arm, twin.drive, [(0, replace(log, current=model + error))])
    given = np.cumsum(error[:-1] * np.diff(t)[:, None], axis=0)
    got = np.cumsum(found.current, axis=0) / found.rate
    assert found.rate == pytest.approx(100, rel=0.01)
    # Up to the stop at the log's end, which is bridged, and half a step of an error of 5.
    for seconds in (5.0, 10.0, 15.0):
        k = np.searchsorted(t, t[0] + seconds)
        np.testing.assert_allclose(got[round(seconds * 100) - 1], given[k - 1], atol=0.08)


def test_a_constant_error_does_not_get_the_jitter_of_the_samples(arm, logs, twin):
    rng = np.random.default_rng(4)
    log = replace(logs[0], t=logs[0].t + 0.003 * rng.uniform(-1, 1, len(logs[0].t)))
    noise = 0.1 * rng.normal(size=log.q.shape)
    model = modelled(arm, twin.drive.friction, twin.drive.gain, log)
    found = left_over(arm, twin.drive, [(0, replace(log, current=model + 5.0 + noise))])
    middle = found.current[200:-200]
    np.testing.assert_allclose(middle.mean(axis=0), 5.0, atol=0.02)
    np.testing.assert_allclose(middle.std(axis=0), 0.1, rtol=0.15)


def test_the_error_of_a_programs_cut_off_is_bridged(logs):
    qd = np.zeros_like(logs[0].qd)
    qd[100:500] = 0.3
    error = np.ones_like(qd)
    error[495:503], error[300] = 200.0, 5.0
    bridged = bridged_stop(replace(logs[0], qd=qd), error)
    assert np.abs(bridged[400:] - 1).max() < 1e-12
    np.testing.assert_array_equal(bridged[:490], error[:490])


def test_the_angle_over_which_friction_turns_around_is_seen_while_a_joint_creeps():
    # At a constant speed after a reversal, Dahl's bristle is 5 (1 - 2 exp(-angle / 2e-3)).
    t = np.arange(800) * 0.01
    way = np.where(t % 4 < 2, 1.0, -1.0)
    torque = way * 5 * (1 - 2 * np.exp(-0.01 * (t % 2 + 0.01) / 2e-3))
    column = (0.01 * way)[:, None]
    motion = Motion(t, column, 0 * column, 0 * column)
    one, level = np.ones(1), 5 * np.ones(1)
    start = Friction(level, level, 0.1 * one, 0 * one, level / USUAL, 0 * one)
    found = turned(start, [motion], [torque[:, None]])
    assert level / found.bristle_stiffness == pytest.approx(2e-3)


def test_quantum_of_a_signal():
    rng = np.random.default_rng(0)
    noisy = np.sin(np.linspace(0, 20, 5000)) + rng.normal(size=5000) * 0.01
    assert quantum(np.rint(noisy / 0.002) * 0.002) == pytest.approx(0.002)
    assert quantum(noisy) == 0


def test_the_observer_sees_nothing_of_a_motion_played_with_its_bodies_alone(arm, logs):
    motion = motion_of(arm, logs[0])
    seen = observe(arm.robot, logs[0].t, logs[0].q, logs[0].qd, motion.bodies, 30.0)
    assert np.abs(seen[:-1]).max() < 1e-9


def test_a_log_is_cut_at_its_gaps(logs):
    keep = np.r_[0:800, 1000:2000]
    gapped = replace(
        logs[0], t=logs[0].t[keep], q=logs[0].q[keep], qd=logs[0].qd[keep],
        current=logs[0].current[keep],
    )  # fmt: skip
    assert [len(part.t) for part in without_gaps(gapped)] == [800, 1000]


def test_intervals_hold_the_friction_of_a_known_arm(arm, logs, twin):
    rest = [fit_twin(arm, [log], np.full(3, 30.0)) for log in logs[:2]]
    found = with_intervals(twin, rest)
    away = np.abs(found.number("viscous") - VISCOUS)
    assert (away < found.intervals["viscous"]).all()
    assert (found.intervals["gain"] == 0).all()
    assert with_intervals(twin, rest[:1]).intervals == {}


def test_friction_at_rest_is_not_invented_from_rows_that_only_show_motion():
    # Rows of .05 to 1 rad/s: exp(-(.05/.02)^2) of what is at rest stands in them, within noise.
    rng = np.random.default_rng(0)
    t = np.arange(3000) * 0.01
    qd = np.where(t % 2 < 1, 1.0, -1.0) * (0.05 + 0.95 * rng.random(3000))
    lost = 5 * np.sign(qd) + 2 * qd
    rows = [column[:, None] for column in (qd, 0 * qd)]
    motion = Motion(t, *rows, rows[1])
    for _ in range(5):
        fit = fit_friction(0, [motion], [(lost + rng.normal(size=3000))[:, None]])
        assert fit.static == pytest.approx(5, abs=2.5)
        assert fit.viscous + fit.slope[3] == pytest.approx(2, abs=0.6)
    noise = 30 * rng.normal(size=3000)
    fit = fit_friction(0, [motion], [(lost + noise)[:, None]])
    assert "static" in fit.priors
    assert fit.static == pytest.approx(fit.coulomb, rel=0.5)
    slow = 0.3 * qd * np.exp(rng.uniform(-4, 0, 3000))  # down to .0003 rad/s: at rest it is 9
    level = 5 + 4 * np.exp(-((slow / 0.1) ** 2))
    torque = (level * np.sign(slow) + 0.1 * rng.normal(size=3000))[:, None]
    fit = fit_friction(0, [Motion(t, slow[:, None], rows[1], rows[1])], [torque])
    assert fit.static == pytest.approx(9, rel=0.15)
    assert "static" not in fit.priors


def cycle(seed, places, shake=0.3, cycles=10):
    """Residuals of a cycle of 6 s: each of its places has its own offset, the same in each turn."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, 6.0 * cycles, 0.01)
    place = (t % 6.0 / 0.2).astype(int)
    offset = np.random.default_rng(places).normal(size=(30, 2))
    phase = 2 * np.pi * t / 6.0
    motion = 10 * np.column_stack([np.cos(phase), np.sin(phase)])
    residual = offset[place] + shake * rng.normal(size=(len(t), 2))
    return Track(t, motion, residual, np.ones((len(t), 2), dtype=bool))


def test_a_cycle_that_repeats_does_not_tell_two_draws_of_one_process_apart():
    a, b = cycle(1, places=10), cycle(2, places=11)
    elsewhere = replace(a, motion=1000 * a.t[:, None])
    # Were no place met twice, the classifier would be tested on what it learned there.
    assert classifier_areas([elsewhere], [b], False)[0] > 0.9
    assert abs(classifier_areas([a], [b], False)[0] - 0.5) < 0.15


def test_a_difference_at_all_places_of_a_cycle_is_found():
    a, b = cycle(1, places=10), cycle(2, places=11, shake=0.45)
    assert classifier_areas([a], [b], False)[0] > 0.95
