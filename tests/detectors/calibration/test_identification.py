"""Identification against the numbers that Pinocchio's inverse dynamics was run with."""

import dataclasses

import numpy as np
import pytest

from oracles.physical_bodies import is_physically_consistent
from tauguard.detectors import ArmModel, gravity_torque, mass_matrix
from tauguard.detectors.calibration.arm_file import load_arm, save_arm
from tauguard.detectors.calibration.assessment import (
    BurstCheck,
    burst_findings,
    left_out,
    load_findings,
    residual_rms,
    start_gains,
    unexplained,
    unexplained_findings,
)
from tauguard.detectors.calibration.identification import RATE, filtered_logs, identify
from tauguard.detectors.calibration.recording import Load, Recording, moving_span
from tauguard.detectors.dynamics.robot import RobotNumbers, momentum_terms
from tauguard.detectors.estimation.observer import intervals, low_pass
from tests.detectors.synthetic_arm import (
    COULOMB,
    GAIN,
    ROTOR,
    VISCOUS,
    XML,
    held_joint,
    nominal,
    record,
    true_model,
)
from tests.oracles.added_contact import Added, add_contact


@pytest.fixture(scope="module")
def logs():
    return [record(seed) for seed in range(3)]


@pytest.fixture(scope="module")
def found(logs):
    return identify(ArmModel(nominal(), GAIN), [Recording(log) for log in logs])


def test_given_gains_fix_the_scale(found):
    arm = found.arm
    truth = RobotNumbers.from_pin(true_model())
    assert found.scale == "gains"
    assert is_physically_consistent(arm.robot.inertial)
    poses = np.random.default_rng(5).uniform(-0.8, 0.8, (20, 3))
    np.testing.assert_allclose(
        gravity_torque(arm.robot, poses), gravity_torque(truth, poses), atol=0.4
    )
    inertia = mass_matrix(arm.robot, poses)
    np.testing.assert_allclose(inertia[:, 1:, 1:], mass_matrix(truth, poses)[:, 1:, 1:], atol=0.15)
    # About the vertical axis only accelerations tell inertia from friction.
    np.testing.assert_allclose(inertia[:, 0, 0], mass_matrix(truth, poses)[:, 0, 0], rtol=0.35)
    np.testing.assert_allclose(arm.friction.coulomb(0.5), COULOMB + 0.5 * VISCOUS, atol=0.8)
    assert arm.robot.armature[1:] == pytest.approx(ROTOR[1:], abs=0.2)


def test_a_log_it_has_not_seen(found):
    fresh = record(9)
    nominal_rms = residual_rms(ArmModel(nominal(), GAIN), fresh)
    assert (residual_rms(found.arm, fresh) < [0.25, 0.4, 0.2]).all()
    assert (nominal_rms > 2).all()


def looked(arm, recordings):
    logs = {str(k): r for k, r in enumerate(recordings)}
    left = unexplained(arm, logs)
    return unexplained_findings(arm.robot.joint_names, left, logs, [])


@pytest.mark.parametrize("load", [Load(), None])
@pytest.mark.parametrize(("first", "second"), [(1, 2), (0, 1)])
def test_currents_of_two_joints_exchanged(logs, found, first, second, load):
    order = [0, 1, 2]
    order[first], order[second] = order[second], order[first]
    mixed = [
        Recording(dataclasses.replace(log, current=log.current[:, order]), load) for log in logs
    ]
    wrong = identify(ArmModel(nominal(), GAIN), mixed)
    (finding,) = looked(wrong.arm, mixed)
    assert finding.severity == "error"
    assert "wrong order, signs" in finding.text
    assert looked(found.arm, [Recording(log, load) for log in logs]) == ()


def test_an_unknown_load_is_explained_and_a_load_that_is_not_told_is_not(found):
    heavy = record(20, load=3.0)
    assert looked(found.arm, [Recording(heavy, None)]) == ()
    (finding,) = looked(found.arm, [Recording(heavy)])
    assert finding.severity == "error"
    assert "a load that was not named" in finding.text


def pushed(trace, every, torque):
    """Pushes of 0.4 s on the last joint, from 2 s on."""
    for at in np.arange(2.0, trace.t[-1] - 1, every):
        trace = add_contact(trace, GAIN, Added(float(at), 0.4, (0.0, 0.5 * torque, torque), "push"))
    return trace


@pytest.mark.parametrize("others", [0, 2])
def test_logs_that_are_touched_all_along_are_named_with_their_seconds(logs, others):
    given = [Recording(pushed(record(7), 3.0, 15.0)), *map(Recording, logs[:others])]
    names = ["touched", "a", "b"][: len(given)]
    arm = identify(ArmModel(nominal(), GAIN), given).arm
    bursts = burst_findings(
        arm.robot.joint_names, unexplained(arm, dict(zip(names, given, strict=True)))
    )
    (finding,) = bursts
    seconds = [float(s) for s in finding.text.split("do, at ")[1].split(" s ")[0].split(", ")[:-1]]
    assert len(seconds) > 4
    assert max(min(abs(s - at) for at in np.arange(2.0, 25, 3.0)) for s in seconds) < 0.3
    assert finding.where[0] == "touched"
    assert finding.accept == "alarms"


def test_free_logs_and_untold_loads_have_no_bursts(logs, found):
    given = {name: Recording(log) for name, log in zip("abc", logs, strict=True)}
    given["heavy"] = Recording(record(20, load=3.0))
    assert not burst_findings(found.arm.robot.joint_names, unexplained(found.arm, given))


@pytest.mark.parametrize("jerks", [True, False])
def test_bursts_while_the_arm_itself_jerks_are_no_contacts(found, jerks):
    """Speeds of the last joint swing, and its model lacks a part of the torque that this takes."""
    log, at = record(7), np.arange(3.0, 22.0, 3.0)
    size = np.exp(-(((log.t[:, None] - at) / 0.1) ** 2)).sum(axis=1)
    shake = 1.5 * size * np.sin(20 * log.t)
    torque = np.gradient(shake, log.t)[:, None] * mass_matrix(found.arm.robot, log.q)[:, :, 2]
    qd = log.qd + jerks * np.column_stack([0 * shake, 0 * shake, shake])
    slides = COULOMB * (np.tanh(qd / 0.02) - np.tanh(log.qd / 0.02)) + VISCOUS * (qd - log.qd)
    shaken = dataclasses.replace(log, qd=qd, current=log.current + (1.4 * torque + slides) / GAIN)
    given = found.arm.robot.joint_names, unexplained(found.arm, {"log": Recording(shaken)})
    assert bool(burst_findings(*given)) == (not jerks)


def test_the_part_that_bursts_leave_unexplained_is_all_of_it(found):
    given = unexplained(found.arm, {"log": Recording(pushed(record(7), 3.0, 15.0))})
    log = given["log"]
    given["log"] = log = dataclasses.replace(log, swing=log.swing + 0.5 * np.abs(log.left))
    (finding,) = burst_findings(found.arm.robot.joint_names, given)
    rows = log.moves[:, 2]
    left, torque = (np.linalg.norm(x[rows, 2]) for x in (log.left, log.torque))
    assert f"log: {100 * left / torque:.0f} % of the torque of" in finding.text
    assert np.linalg.norm(log.without_accelerations()[rows, 2]) < 0.9 * left


def test_the_swing_is_the_largest_torque_of_accelerations_nearby(found):
    log = record(7)
    p = momentum_terms(found.arm.robot, log.q, log.qd)[0]
    change = np.abs(low_pass(np.full(3, RATE), intervals(log.t, len(p)), p, np.zeros_like(p)))
    rows = round(BurstCheck.swing_span / log.dt)
    swing = unexplained(found.arm, {"log": Recording(log)})["log"].swing
    for k in (0, 1, rows, len(p) // 2, len(p) - rows, len(p) - 1):
        near = change[max(k - rows, 0) : k + rows + 1]
        np.testing.assert_array_equal(swing[k], near.max(axis=0))


@pytest.mark.parametrize("given", [2.0, 3.0, 6.0])
def test_a_load_that_the_torques_do_not_show_is_named(logs, given):
    arm, load = ArmModel(nominal(), GAIN), Load(given, (0.3, 0.0, 0.05))
    recordings = {name: Recording(log) for name, log in zip("abc", logs, strict=True)}
    recordings["heavy"] = Recording(record(20, load=3.0), load)
    findings = load_findings(arm, recordings, filtered_logs(arm, list(recordings.values())))
    assert [one.where for one in findings] == ([] if given == 3.0 else [("heavy",)])


def test_each_log_left_out_once(logs, found):
    held = left_out(ArmModel(nominal(), GAIN), [Recording(log) for log in logs])
    assert len(held) == 3
    assert (np.array(held) < [0.4, 0.6, 0.3]).all()


def test_a_known_payload_fixes_the_scale(logs):
    recordings = [Recording(log) for log in logs]
    recordings += [Recording(record(k, load=3.0), Load(3.0, (0.3, 0.0, 0.05))) for k in (20, 21)]
    guess = ArmModel(nominal(), 1.4 * GAIN)
    by_payload = identify(guess, recordings, scale="payload")
    # The base's axis is vertical: no payload's weight reaches it, only its inertia does.
    np.testing.assert_allclose(by_payload.arm.drive_gain[1:], GAIN[1:], rtol=0.06)
    assert (by_payload.gain_error[1:] < by_payload.gain_error[0]).all()


def test_the_masses_fix_the_scale_if_nothing_else_does(logs):
    by_masses = identify(
        ArmModel(nominal(), 1.4 * GAIN), [Recording(log) for log in logs], scale="masses"
    )
    # The file's masses are 15 % too small, and so are the gains that they give.
    assert by_masses.arm.drive_gain[1:] == pytest.approx(GAIN[1:] / 1.15, rel=0.12)


def test_an_unknown_payload_is_found(logs):
    recordings = [*(Recording(log) for log in logs), Recording(record(30, load=2.0), None)]
    result = identify(ArmModel(nominal(), GAIN), recordings)
    assert result.loads[-1, 0] == pytest.approx(2.0, abs=0.3)
    assert result.loads[:-1, 0] == pytest.approx(0.0, abs=1e-3)


def test_the_inertia_of_a_load_is_found():
    """A load far from the last link's origin, whose inertia matters: without it, 2 N m are left."""
    logs = [Recording(record(seed)) for seed in range(3)]
    found = identify(ArmModel(nominal(), GAIN), [*logs, Recording(record(30, load=4.0), None)])
    mass, inertia = found.loads[-1, 0], found.loads[-1, 6]  # about the joint's axis, y
    assert mass == pytest.approx(4.0, abs=0.4)
    assert inertia == pytest.approx(4.0 * (0.3**2 + 0.05**2), abs=0.15)


def test_a_wrist_whose_rotor_outweighs_its_link():
    found = identify(ArmModel(nominal(), GAIN), [Recording(record(seed)) for seed in range(3)])
    light = mass_matrix(nominal(), np.zeros((1, 3)))[0, 2, 2]
    assert ROTOR[2] > 2 * light
    assert found.arm.robot.armature[2] == pytest.approx(ROTOR[2], abs=0.1)


def test_first_guess_of_the_gains(logs):
    assert start_gains(nominal(), logs) == pytest.approx(GAIN, rel=0.6)


def test_standstill_at_both_ends_is_trimmed():
    log = record(3, dwell=(-1.0, 4.0))
    assert not moving_span(log)[:300].any()
    with pytest.raises(ValueError, match="without the first 1000 s"):
        moving_span(log, margin=1000)


def test_file_and_back(tmp_path, found):
    source, target = tmp_path / "arm.xml", tmp_path / "calibrated.xml"
    source.write_text(XML)
    assert load_arm(source) is None
    save_arm(found.arm, source, target, scale=found.scale)
    back = load_arm(target)
    np.testing.assert_allclose(back.robot.inertial, found.arm.robot.inertial, atol=1e-8)
    np.testing.assert_array_equal(back.drive_gain, found.arm.drive_gain)
    np.testing.assert_array_equal(back.friction.weights, found.arm.friction.weights)
    target.write_text(target.read_text().replace("drive_gain", "gain"))
    with pytest.raises(ValueError, match="calibration cannot be read"):
        load_arm(target)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"scale": "payload"}, "no recording has a known load"),
        ({"scale": "guess"}, "expected gains, payload or masses"),
        ({"recordings": []}, "no recordings"),
    ],
)
def test_what_cannot_be_identified(logs, change, message):
    arguments = {"recordings": [Recording(logs[0])], "scale": "gains"} | change
    with pytest.raises(ValueError, match=message):
        identify(ArmModel(nominal(), GAIN), **arguments)


def test_a_log_without_motion():
    still = record(1, dwell=(-1.0, 99.0))
    with pytest.raises(ValueError, match="no joint moves"):
        identify(ArmModel(nominal(), GAIN), [Recording(still)])


def test_an_interval_of_the_bodies_holds_the_truth_and_shrinks_with_more_logs():
    # By 3 standard deviations: the errors of records are their noise, and friction that tanh is.
    truth = RobotNumbers.from_pin(true_model()).inertial
    one, three = (
        identify(ArmModel(nominal(), GAIN), [Recording(record(k)) for k in range(1, count)])
        for count in (2, 4)
    )
    away = np.abs(three.arm.robot.inertial - truth)
    shown = np.isfinite(three.inertial_error)
    assert shown.any()
    assert (away[shown] < 3 * three.inertial_error[shown]).all()
    both = shown & np.isfinite(one.inertial_error)
    assert (three.inertial_error[both] <= one.inertial_error[both] * 1.001).all()
    assert np.isnan(three.inertial_error[0, 0])  # the mass on a vertical axis loads nothing


def test_the_noise_of_a_joint_that_never_moves_is_that_of_the_others():
    """With a tiny noise every contact would be one of that joint."""
    held = identify(ArmModel(nominal(), GAIN), [Recording(held_joint(seed)) for seed in range(2)])
    assert held.rms[2] == 0
    assert held.arm.noise[2] == held.arm.noise[:2].max()
