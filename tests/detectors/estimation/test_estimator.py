"""The estimator: plain without unknowns, online as in batch, and payloads found."""

import numpy as np
import pytest

from tauguard.detectors import ArmModel, Estimator, FrictionModel, Unknowns, observe


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
    out = np.empty((3, 6))
    for k in range(2000):
        dt = trace.t[k] - trace.t[k - 1] if k else None
        estimator.step(trace.q[k], trace.qd[k], trace.current[k], out, dt)
        assert out[0].tobytes() == batch.residual[k].tobytes()
        assert out[1].tobytes() == batch.unexplained[k].tobytes()
        assert out[2].tobytes() == batch.acceleration[k].tobytes()
    np.testing.assert_array_equal(estimator.tracked(), batch.unknowns[1999])


def test_an_unknown_payload_is_tracked(training, alarm):
    heavy = next(t for t in training if t.truth.payload[-1] == 4.0 and not t.truth.collisions)
    empty = next(t for t in training if t.truth.payload[-1] == 0.0 and not t.truth.collisions)
    masses = []
    estimator = Estimator(alarm.detector.arm)
    for trace in (empty, heavy):
        run = estimator.run(trace.t, trace.q, trace.qd, trace.current, keep=True)
        masses.append(-np.median(run.unknowns[10000:, 0]))
    assert masses[1] - masses[0] == pytest.approx(4.0, abs=0.6)


def test_what_an_unknown_payload_could_explain_counts_less(training, alarm):
    trace = next(t for t in training if not t.truth.collisions)
    plain, careful = (
        Estimator(alarm.detector.arm, unknowns=u).run(
            trace.t, trace.q, trace.qd, trace.current, keep=True
        )
        for u in (Unknowns(), Unknowns.for_detection())
    )
    np.testing.assert_array_equal(plain.unknowns, careful.unknowns)
    np.testing.assert_array_equal(np.sign(plain.unexplained), np.sign(careful.unexplained))
    share = np.abs(careful.unexplained) / np.maximum(np.abs(plain.unexplained), 1e-12)
    assert share.max() <= 1
    # A payload's part is a guess in the beginning and known once the arm has moved.
    assert share[2:9, 1].max() < 0.2 < np.median(share[5000:, 1])
    with pytest.raises(ValueError, match="payload_weight -1"):
        Unknowns(payload_weight=-1)


def test_bad_samples_leave_the_state_alone(training, alarm):
    trace = training[0]
    good, bad = Estimator(alarm.detector.arm), Estimator(alarm.detector.arm)
    a, b = np.empty((3, 6)), np.empty((3, 6))
    for k in range(30):
        sample = trace.q[k], trace.qd[k], trace.current[k]
        good.step(*sample, a)
        with pytest.raises(ValueError, match="current: every entry must be finite"):
            bad.step(sample[0], sample[1], np.full(6, np.nan), b)
        with pytest.raises(ValueError, match="q: expected one entry a joint"):
            bad.step(sample[0][:5], sample[1], sample[2], b)
        bad.step(*sample, b)
        assert a.tobytes() == b.tobytes()
