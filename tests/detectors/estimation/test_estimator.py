"""The estimator: plain without unknowns, online as in batch, and payloads found."""

from dataclasses import replace

import numpy as np
import pytest

from tauguard.detectors import ArmModel, Estimator, FrictionModel, mass_matrix, observe
from tauguard.detectors.estimation.estimator import Unknowns
from tauguard.traces import resampled


def test_without_unknowns_and_friction_it_is_the_momentum_observer(training, robot, drive_gain):
    trace = training[0]
    plain = Estimator(ArmModel(robot, drive_gain), 50.0, unknowns=Unknowns.none())
    run = plain.run(trace.t, trace.q, trace.qd, trace.current)
    truth = observe(robot, trace.t, trace.q, trace.qd, trace.current * drive_gain, 50.0)
    np.testing.assert_allclose(run.residual, truth, atol=1e-9)
    np.testing.assert_array_equal(run.residual, run.unexplained)


def test_friction_is_taken_off_the_drive_torque(training, robot, drive_gain):
    trace = training[0]
    friction = FrictionModel.coulomb_viscous(np.arange(1.0, 7), np.arange(6.0), 0.01)
    arm = ArmModel(robot, drive_gain, friction)
    run = Estimator(arm, 50.0, unknowns=Unknowns.none()).run(
        trace.t, trace.q, trace.qd, trace.current
    )
    tau = trace.current * drive_gain
    tau = tau - friction.torque(trace.q, trace.qd, tau)
    truth = observe(robot, trace.t, trace.q, trace.qd, tau, 50.0)
    np.testing.assert_allclose(run.residual, truth, atol=1e-9)


def test_online_equals_batch_bitwise(training, alarm):
    trace = training[1]
    estimator = Estimator(alarm.detector.arm)
    batch = estimator.run(trace.t, trace.q, trace.qd, trace.current, keep=True)
    estimator.reset()
    out = np.empty((6, 6))
    for k in range(2000):
        dt = trace.t[k] - trace.t[k - 1] if k else None
        estimator.step(trace.q[k], trace.qd[k], trace.current[k], out, dt)
        assert out[0].tobytes() == batch.residual[k].tobytes()
        assert out[1].tobytes() == batch.unexplained[k].tobytes()
        assert out[2:].tobytes() == batch.motion[k].tobytes()


def test_an_unknown_payload_is_tracked(training, alarm):
    heavy = next(t for t in training if t.truth.payload[-1] == 4.0 and not t.truth.collisions)
    empty = next(t for t in training if t.truth.payload[-1] == 0.0 and not t.truth.collisions)
    masses = []
    estimator = Estimator(alarm.detector.arm)
    for trace in (empty, heavy):
        run = estimator.run(trace.t, trace.q, trace.qd, trace.current, keep=True)
        masses.append(-np.median(run.unknowns[10000:, 0]))
    assert masses[1] - masses[0] == pytest.approx(4.0, abs=0.6)


def test_what_is_uncertain_counts_less(training, alarm):
    trace = next(t for t in training if not t.truth.collisions)
    known = Unknowns.for_detection()
    whole, careful = (
        Estimator(alarm.detector.arm, unknowns=u).run(
            trace.t, trace.q, trace.qd, trace.current, keep=True
        )
        for u in (replace(known, weighted=False), known)
    )
    np.testing.assert_array_equal(whole.unknowns, careful.unknowns)
    np.testing.assert_array_equal(np.sign(whole.unexplained), np.sign(careful.unexplained))
    share = np.abs(careful.unexplained) / np.maximum(np.abs(whole.unexplained), 1e-12)
    assert share.max() <= 1
    # A payload's part is a guess in the beginning and known once the arm has moved.
    assert share[8, 1] < 0.3 < np.median(share[5000:, 1])


def test_a_change_of_friction_counts_in_what_the_noise_grows_with_and_nowhere_else(
    robot, drive_gain
):
    level, gain, start = 10.0, 200.0, 300
    friction = FrictionModel.coulomb_viscous(np.full(6, level), np.zeros(6), width=1e-6)
    arm = ArmModel(robot, drive_gain, friction, noise=np.ones(6))
    t = np.arange(1000) * 1e-3
    qd = np.where((t >= start * 1e-3)[:, None], 0.5, 0.0) * np.ones(6)
    q = 0.2 + np.cumsum(qd, axis=0) * 1e-3
    known = Unknowns(payload=0.0, moment=0.0, transition=0.3, weighted=True)
    whole, careful = (
        Estimator(arm, gain, unknowns=u).run(t, q, qd, np.ones_like(q))
        for u in (replace(known, weighted=False), known)
    )
    np.testing.assert_array_equal(careful.unexplained, whole.unexplained)
    since = t[start + 1 :] - t[start]  # friction is a step behind two low-passes
    change = level * gain / (gain - 30) * (np.exp(-30 * since) - np.exp(-gain * since))
    most = np.maximum.accumulate(change)
    got = careful.motion[start + 1 :, 2]
    assert (careful.motion[1:start, 2] == 0).all()
    top = int(change.argmax())
    np.testing.assert_allclose(got[:top], np.broadcast_to(most[:top, None], (top, 6)), atol=0.5)
    late = most[-1] * np.exp(-(since - since[top]) / 0.3)  # it is forgotten slowly
    np.testing.assert_allclose(got[top + 50], np.full(6, late[top + 50]), rtol=0.05)


def test_the_noise_of_a_slow_log_grows_with_half_a_change_of_torque(training, robot, drive_gain):
    trace = resampled(training[0], 25.0)
    friction = FrictionModel.coulomb_viscous(np.arange(1.0, 7), np.arange(6.0), 0.01)
    arm = ArmModel(robot, drive_gain, friction)
    given = trace.t, trace.q, trace.qd, trace.current
    slow = Estimator(arm, dt=trace.dt, sampled=True).run(*given).motion[:, 3]
    held = Estimator(arm, dt=trace.dt).run(*given).motion[:, 3]
    tau = trace.current * drive_gain
    tau = tau - friction.torque(trace.q, trace.qd, tau)
    np.testing.assert_allclose(slow[1:], np.abs(np.diff(tau, axis=0)) / 2, atol=1e-9)
    assert (held == 0).all()


def test_an_error_that_lasts_is_not_taken_for_friction_that_changed(training, alarm):
    trace = next(t for t in training if not t.truth.collisions)
    arm, rng = alarm.detector.arm, np.random.default_rng(0)
    # Torques of the deviation that is believed, each for 0.2 s; else the model is right.
    held = np.repeat(rng.normal(size=(len(trace.t) // 200 + 1, 6)), 200, axis=0)[: len(trace.t)]
    current = trace.current + held * arm.noise / arm.drive_gain
    worst = {}
    for lasting in (1.0, 20.0):
        estimator = Estimator(arm, unknowns=Unknowns(noise_inflation=lasting))
        clean, disturbed = (
            estimator.run(trace.t, trace.q, trace.qd, c, keep=True).unknowns
            for c in (trace.current, current)
        )
        worst[lasting] = np.abs((disturbed - clean)[:, 6::3]).max()
    # One tenth is what is believed of friction that warmed up or cooled down.
    assert worst[20.0] < 0.15 < worst[1.0]
    assert worst[20.0] < 0.5 * worst[1.0]


@pytest.mark.parametrize("joint", [0, 1, 2])
def test_a_held_contact_is_not_learned(training, alarm, joint):
    """Half a second of 30 deviations: most is still seen at its end, little stays behind."""
    trace = next(t for t in training if not t.truth.collisions)
    arm, t = alarm.detector.arm, trace.t - trace.t[0]
    held = np.zeros_like(trace.current)
    held[(t >= 4.0) & (t < 4.5), joint] = 30 * arm.noise[joint] / arm.drive_gain[joint]
    estimator = Estimator(arm, unknowns=Unknowns.for_detection())
    free, struck = (
        estimator.run(trace.t, trace.q, trace.qd, c).unexplained / arm.noise
        for c in (trace.current, trace.current + held)
    )
    seen = np.abs(struck - free)
    assert seen[np.searchsorted(t, 4.49), joint] > 10
    assert seen[np.searchsorted(t, 4.6)].max() < 2


@pytest.mark.parametrize("wrong", [{"noise_inflation": 0.5}, {"transition": -1.0}])
def test_what_unknowns_may_be(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        Unknowns(**wrong)


def test_bad_samples_leave_the_state_alone(training, alarm):
    trace = training[0]
    good, bad = Estimator(alarm.detector.arm), Estimator(alarm.detector.arm)
    a, b = np.zeros((2, 6, 6))
    for k in range(30):
        sample = trace.q[k], trace.qd[k], trace.current[k]
        good.step(*sample, a)
        with pytest.raises(ValueError, match="current: every entry must be finite"):
            bad.step(sample[0], sample[1], np.full(6, np.nan), b)
        with pytest.raises(ValueError, match="q: expected one entry per joint"):
            bad.step(sample[0][:5], sample[1], sample[2], b)
        bad.step(*sample, b)
        assert a.tobytes() == b.tobytes()


def test_motion_tells_inertia_and_its_torque_with_the_tracked_payload(training, alarm):
    trace, robot = training[1], alarm.detector.arm.robot
    arm = replace(alarm.detector.arm, sensors=None)  # velocities as measured
    run = Estimator(arm).run(trace.t, trace.q, trace.qd, trace.current, keep=True)
    smooth, keep = trace.qd[0].copy(), np.exp(-30.0 * np.diff(trace.t))
    for k in range(1, 15002):
        smooth = trace.qd[k] - (trace.qd[k] - smooth) * keep[k - 1]
        if k not in (1, 5001, 15001):
            continue
        # It is weighed with every tenth sample, and holds for those that follow.
        inertial = robot.inertial.copy()
        inertial[-1, :4] -= run.unknowns[k - 1, :4]
        inertia = np.abs(mass_matrix(robot.with_inertial(inertial), trace.q[k - 1, None])[0])
        acceleration = np.abs(30.0 * (trace.qd[k] - smooth))
        np.testing.assert_allclose(run.motion[k, 0], inertia @ acceleration, rtol=1e-9)
        np.testing.assert_allclose(run.motion[k, 1], np.linalg.norm(inertia, axis=1), rtol=1e-9)
