from functools import cache

import numpy as np
import pytest

from tauguard.detectors import RobotNumbers
from tauguard.detectors.diagnosis.contact_force import (
    Trust,
    contact_belief,
    link_poses,
    point_jacobians,
)
from tauguard.detectors.diagnosis.post_alarm import PostAlarmWindow
from tauguard.detectors.diagnosis.severity import (
    COVERAGE,
    LONG,
    ContactTorque,
    Interval90,
    force_draws,
    severity,
)
from tauguard.models import cura6, link_surface, pin_model
from tauguard.report import two_digits

XML = cura6.arm_xml()
ROBOT = RobotNumbers.from_pin(pin_model(XML))
HOME = np.array(cura6.HOME)
TORQUE = np.array([20.0, 30.0, 10.0, 4.0, 1.0, 0.5])


@cache
def surface():
    return link_surface(XML)


def seen(torque, seconds, lag, dt=1e-3, after=0.3):
    """What an observer of this lag makes of a half sine of ``torque`` that lasts ``seconds``."""
    t = np.arange(-0.02, after, dt)
    fine = np.arange(-0.02, after, 1e-5)
    force = np.sin(np.pi * np.clip(fine / seconds, 0, 1))
    residual, now = np.empty(len(fine)), 0.0
    for k, value in enumerate(force):
        now += (1 - np.exp(-1e-5 / lag)) * (value - now)
        residual[k] = now
    level = np.interp(t, fine, residual)
    still = np.tile(HOME, (len(t), 1))
    empty, envelope = np.zeros((len(t), 6, 4)), np.full_like(still, 0.2)
    motionless = np.zeros_like(still)
    rows = np.arange(len(t))
    return PostAlarmWindow(
        rows, t, still, motionless, np.outer(level, torque), envelope, empty, lag
    )


@pytest.mark.parametrize("lag", [0.002, 0.005, 0.02, 0.04])
@pytest.mark.parametrize("seconds", [0.02, 0.1])
def test_the_impulse_at_the_joints_does_not_depend_on_the_lag(lag, seconds):
    contact_torque = ContactTorque.of(seen(TORQUE, seconds, lag))
    np.testing.assert_allclose(contact_torque.impulse, TORQUE * seconds * 2 / np.pi, rtol=0.12)
    # The peak is blurred where the blow is as short as the lag, and never too high.
    assert (contact_torque.peak <= 1.01 * TORQUE).all()
    if seconds > 4 * lag:
        np.testing.assert_allclose(contact_torque.peak, TORQUE, rtol=0.05)


def contact(link, row, force):
    """Torques of a force on a point of a link's surface."""
    rows = np.flatnonzero(surface().link == link)
    at = rows[row]
    poses = link_poses(ROBOT, HOME)
    point = poses.origin[link] + poses.rotation[link] @ surface().point[at]
    inward = -poses.rotation[link] @ surface().normal[at]
    jacobian = point_jacobians(ROBOT, poses, np.array([link]), point[None])[0]
    return jacobian.T @ (force * inward)


def believed(residual, noise):
    return contact_belief(ROBOT, surface(), HOME, residual, noise)


@pytest.mark.parametrize("row", [3, 40, 90])
def test_draws_have_the_mean_of_the_closed_form(row):
    noise = np.full(6, 0.5)
    residual = contact(5, row, 60.0)
    belief = believed(residual, noise)
    drawn = force_draws(ROBOT, surface(), HOME, residual, noise, belief.probability, 4000)
    mean = belief.probability @ belief.force
    np.testing.assert_allclose(drawn.mean(axis=0), mean, atol=0.06 * np.linalg.norm(mean) + 0.5)


def said(link, row, force, seconds=0.05):
    after = seen(contact(link, row, force), seconds, 0.005)
    contact_torque = ContactTorque.of(after)
    noise = Trust().noise(contact_torque.mean, after.deviation[0])
    return severity(ROBOT, surface(), after, believed(contact_torque.mean, noise), 1, Trust())


def test_most_intervals_hold_what_happened():
    cases = [(link, row, 80.0) for link in (2, 3, 4, 5) for row in range(0, 150, 15)]
    found = [said(*case) for case in cases]
    assert np.mean([f.peak.low <= 80 <= f.peak.high for f in found]) >= COVERAGE - 0.1
    impulse = 80 * 0.05 * 2 / np.pi
    assert np.mean([f.impulse.low <= impulse <= f.impulse.high for f in found]) >= COVERAGE - 0.1
    for name in ("peak", "impulse"):  # from 0 to infinity would hold it, too
        assert np.median([getattr(f, name).high / getattr(f, name).low for f in found]) < 4.5


def test_only_a_contact_at_the_tool_is_averaged_over_a_part_of_its_time():
    found = said(5, 40, 80.0, 0.2)
    assert found.torque.hidden == pytest.approx(0.003 / 0.182)
    ends = [(one.low, one.value, one.high) for one in (found.impulse, found.peak)]
    np.testing.assert_allclose(ends[0], (7.003, 9.869, 14.443), rtol=1e-3)
    np.testing.assert_allclose(ends[1], (56.21, 79.29, 116.11), rtol=1e-3)
    after = seen(TORQUE, 0.2, 0.005)
    np.testing.assert_allclose(ContactTorque.of(after).peak, 0.99992 * TORQUE, rtol=1e-5)
    longer = ContactTorque.of(after, LONG)
    assert longer.hidden == pytest.approx(0.003 / 0.182)
    np.testing.assert_allclose(longer.peak, 0.9963 * TORQUE, rtol=1e-4)


def test_a_force_that_no_joint_feels_is_not_identifiable():
    # Link 1 turns about the vertical: most of a force on it is held by the bearing.
    hidden = said(0, int(np.argmin([abs(contact(0, k, 1.0)[0]) for k in range(150)])), 290.0)
    assert not hidden.peak.identifiable
    words, torque = hidden.text("push", ROBOT.joint_names), np.abs(hidden.torque.peak)
    joint, least = ROBOT.joint_names[int(torque.argmax())], two_digits(hidden.peak.low)
    start = f"{two_digits(torque.max())} N m at {joint}, peak force at least {least} N ("
    assert words.startswith(start)
    assert two_digits(hidden.peak.high) not in words  # hundreds of N, of no use to a reader
    assert said(5, 40, 80.0).peak.identifiable


def test_the_interval_is_that_of_the_draws():
    between = Interval90.of(np.linspace(0, 100, 1001))
    assert (between.low, between.value, between.high) == pytest.approx((5, 50, 95))
    assert Interval90(123.4, 98.7, 151.0).text("N") == "120 N [99, 150]"
    assert Interval90(40.0, 2.0, 151.0).text("N") == "at least 2 N"
