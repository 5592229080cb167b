from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from tauguard.detectors import ArmModel, Diagnoser, RobotNumbers, diagnose
from tauguard.detectors.diagnosis.classification import KINDS, load, signs
from tauguard.detectors.diagnosis.post_alarm import PostAlarmWindow, PostAlarmWindows
from tauguard.envs import CollisionPlan, Episode, PayloadPick, simulate
from tauguard.models import cura6, cura6_drive, link_surface, pin_model
from tauguard.traces import Alarm

XML = cura6.arm_xml()
PIN = pin_model(XML)
ROBOT = RobotNumbers.from_pin(PIN)
ARM = ArmModel(ROBOT, np.array(cura6_drive().gain), noise=np.full(6, 0.1))


def payload_torque(q, mass, com):
    """What gravity does at the joints to a payload on the last link [N m]."""
    data = PIN.createData()
    pin.forwardKinematics(PIN, data, q)
    pin.computeJointJacobians(PIN, data, q)
    jacobian = pin.getJointJacobian(PIN, data, 6, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
    weight = np.array([0.0, 0.0, -9.81 * mass])
    return jacobian.T @ np.concatenate([weight, np.cross(data.oMi[6].rotation @ com, weight)])


def made(shape, torque, columns=None):
    """The aftermath of a residual ``torque`` times ``shape``, sampled at 1 kHz from -20 ms on."""
    t = (np.arange(len(shape)) - 20) * 1e-3
    still = np.tile(np.array(cura6.HOME), (len(t), 1))
    return PostAlarmWindow(
        np.arange(len(t)),
        t,
        still,
        np.zeros_like(still),
        np.outer(shape, torque),
        np.full_like(still, 0.5),
        np.zeros((len(t), 6, 4)) if columns is None else np.tile(columns, (len(t), 1, 1)),
    )


def gravity_columns(q):
    unit = [payload_torque(q, 1.0, np.zeros(3))]
    unit += [payload_torque(q, 1.0, axis) - unit[0] for axis in np.eye(3)]
    return np.array(unit).T


TIME = (np.arange(320) - 20) * 1e-3
AGAINST, WITH = np.array([-1.0, 0, 0]), np.array([1.0, 0, 0])
FORCE = 80 * WITH


@pytest.mark.parametrize(
    ("shape", "velocity", "kind"),
    [
        (np.exp(-(((TIME - 0.005) / 0.006) ** 2)), AGAINST, "transient"),
        (np.sin(np.pi * np.clip(TIME / 0.15, 0, 1)), WITH, "transient"),
        (1 - np.exp(-np.clip(TIME, 0, None) / 0.01), AGAINST, "clamp"),
        (np.sin(np.pi * np.clip((TIME + 0.02) / 1.4, 0, 1)), WITH, "push"),
    ],
)
def test_kinds_of_contact(shape, velocity, kind):
    torque = np.array([20.0, 30.0, 10.0, 4.0, 1.0, 0.5])
    shares = signs(made(shape, torque), FORCE, velocity).probabilities()
    assert tuple(shares) == KINDS
    assert sum(shares.values()) == pytest.approx(1.0)
    assert max(shares, key=shares.get) == kind


def test_a_payload_is_told_from_a_contact_by_its_torques_and_weighed():
    q, com = np.array(cura6.HOME), np.array([0.02, 0.09, -0.01])
    step = 1 - np.exp(-np.clip(TIME, 0, None) / 0.005)
    after = made(step, payload_torque(q, 1.7, com), gravity_columns(q))
    share, mass, reach = load(after)
    assert share > 0.99
    assert mass == pytest.approx(1.7, rel=0.01)
    # A still pose does not show how far up or down the payload's centre is.
    assert 0.0 < reach <= 1.01 * np.linalg.norm(com)
    found = signs(after, FORCE, WITH).probabilities()
    assert max(found, key=found.get) == "payload"
    other = made(step, np.array([40.0, -5, 30, 12, -9, 8]), gravity_columns(q))
    assert signs(other, FORCE, AGAINST).probabilities()["payload"] < 0.1


@pytest.fixture(scope="module")
def trace():
    """An arm that is as it is believed to be: two pulses on known links, then a payload."""
    pulses = tuple(
        CollisionPlan("pulse", time, link, severity=(16.0, 32.0), duration=0.1)
        for time, link in ((1.0, 6), (2.5, 5))
    )
    return simulate(
        Episode(
            5, 5.0, 20.0, collisions=pulses, picks=(PayloadPick(4.2, 2000.0),), ideal_drive=True
        )
    )


def alarms(trace):
    times = [c.onset + 0.006 for c in trace.truth.collisions] + [4.206]
    return [Alarm(time, time + 0.05) for time in times]


def test_simulated_contacts_and_payload(trace):
    found = Diagnoser(ARM, link_surface(XML)).diagnose(trace, alarms(trace))
    assert len(found) == 3
    for diagnosis, collision in zip(found, trace.truth.collisions, strict=False):
        assert diagnosis.kind == "transient"
        assert diagnosis.collision
        assert diagnosis.link == collision.link
        assert diagnosis.links.sum() == pytest.approx(1.0)
        assert abs(diagnosis.time - (collision.onset + 0.05)) < 0.03
        assert np.linalg.norm(diagnosis.force - collision.force) < 0.35 * np.linalg.norm(
            collision.force
        )
        assert np.linalg.norm(diagnosis.point - collision.point) < 0.05
    assert found[2].kind == "payload"
    assert not found[2].collision
    assert found[2].signs.mass == pytest.approx(2.0, rel=0.1)


def test_a_known_load_does_not_change(trace):
    known = replace(Diagnoser(ARM, link_surface(XML)), load_known=True)
    found = known.diagnose(trace, alarms(trace))
    assert [one.collision for one in found] == [True] * 3
    assert all(one.kinds["payload"] == 0 for one in found)
    assert sum(found[2].kinds.values()) == pytest.approx(1.0)


def test_a_link_that_the_leading_joint_lies_beyond_is_not_named(trace):
    first = Diagnoser(ARM, link_surface(XML)).diagnose(trace, alarms(trace))[0]
    sure = replace(first, links=np.eye(6)[first.link - 1])
    for joint in range(6):
        torque = replace(first.severity.torque, peak=9.0 * np.eye(6)[joint])
        one = replace(sure, severity=replace(first.severity, torque=torque))
        assert one.link_identifiable == (joint < first.link)
        named = (
            f"link {first.link} (of joint {trace.joint_names[first.link - 1]}, probability 1.00)"
        )
        assert (named in one.summary) == one.link_identifiable


def test_what_was_known_before_the_alarm_is_kept(trace):
    looked = PostAlarmWindows(ARM, None, trace).at(4.2)
    # The estimator takes the payload up within seconds; the aftermath goes on showing it.
    truth = payload_torque(trace.q[looked.rows[-1]], 2.0, [0, 0.098, 0])
    np.testing.assert_allclose(looked.residual[-1], truth, atol=2.0)
    assert np.abs(looked.residual[0]).max() < 1.0
    assert looked.t[0] == pytest.approx(-0.02, abs=2e-3)
    assert looked.t[-1] == pytest.approx(0.3, abs=2e-3)


def test_the_force_of_a_late_alarm_is_that_of_the_whole_contact(trace):
    looked = PostAlarmWindows(ARM, None, trace)
    late = Alarm(4.4, 4.9)
    truth = payload_torque(trace.q[np.searchsorted(trace.t, 4.5)], 2.0, [0, 0.098, 0])
    whole = looked.whole(late)
    assert 4.1 < late.start + whole.t[0] < 4.2
    assert late.start + whole.t[-1] == pytest.approx(late.end, abs=2e-3)
    peak = whole.residual[np.abs(whole.residual[:, 1]).argmax()]
    np.testing.assert_allclose(peak, truth, atol=3.0)
    # Not before the end of the alarm that came first.
    assert looked.whole(late, 4.3).t[0] == pytest.approx(-0.12, abs=2e-3)


def test_alarms_of_any_detector_are_explained(trace, alarm):
    explained = diagnose(alarm, trace)
    assert len(explained) == len(alarm.detect(trace).alarms)
    arm, surface = alarm.detector.arm, link_surface(XML, 40)
    learned, used = arm.noise_model.weights, Diagnoser.of(arm, surface).noise_model
    np.testing.assert_array_equal(used.weights[:, 1:], learned[:, 1:])
    np.testing.assert_array_equal(used.weights[:, 0], np.maximum(learned[:, 0], arm.noise))
    assert Diagnoser.of(ARM, surface).noise_model is None
    bare = replace(trace, attachments={})  # the detector knows its robot
    for one, two in zip(explained, diagnose(alarm, bare), strict=True):
        assert (one.summary, one.force.tobytes()) == (two.summary, two.force.tobytes())
    with pytest.raises(ValueError, match=r"no arm\.xml"):
        diagnose(replace(alarm, robot=None), bare)
    with pytest.raises(ValueError, match="start 99"):
        PostAlarmWindows(arm, used, trace).at(99.0)


@pytest.mark.parametrize("stride", [1, 10, 42])
def test_alarms_anywhere_and_at_any_rate_are_explained(trace, stride):
    """The first and the last sample, 100 Hz, and the 24 Hz of slow recordings."""
    tables = {n: getattr(trace, n)[::stride] for n in ("t", "q", "qd", "current")}
    none = dict.fromkeys(("q_des", "qd_des", "qdd_des"))
    slow = replace(trace, truth=None, **none, **tables)
    times = [*slow.t[[0, 1, 2, -2, -1]], *(a.start for a in alarms(trace))]
    found = Diagnoser(ARM, link_surface(XML, 40)).diagnose(slow, [Alarm(t, t) for t in times])
    for one in found:
        assert np.isfinite(one.force).all()
        assert np.isfinite(one.point).all()
        assert one.kinds[one.kind] == max(one.kinds.values())
        assert sum(one.kinds.values()) == pytest.approx(1.0)
    if stride < 42:  # at 24 Hz the observer lags by 0.2 s: a pulse of 0.1 s is not seen to end
        assert found[-1].kind == "payload"
        assert {one.kind for one in found[5:7]} <= {"transient", "clamp"}
