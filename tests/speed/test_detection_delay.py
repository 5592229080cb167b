"""The delay of a detector on a contact's torque, beside the closed form of its observer."""

import math

import numpy as np
import pytest

import tauguard
from tauguard.datasets.plans import free_episodes
from tauguard.detectors.alarms.alarm import CollisionAlarm
from tauguard.detectors.calibration.nominal import nominal_arm
from tauguard.detectors.estimation.observer import PLAIN_GAIN
from tauguard.detectors.features.front_end import FrontEndSettings, Scaling
from tauguard.detectors.scores.baselines import FittedThresholds
from tauguard.envs import simulate
from tauguard.findings import ArgumentError, MismatchError
from tauguard.models import BODY_REGIONS
from tauguard.speed import Program, SpeedOptions
from tauguard.speed.detection_delay import DelayModel
from tauguard.traces import Trace

LIMIT = 20.0  # [N m]
TOUCH = 5.0  # [s]


@pytest.fixture(scope="module")
def trace():
    return simulate(free_episodes(3, 1, 8.0, (20.0,), (0.0,))[0])


@pytest.fixture(scope="module")
def model(trace):
    front = FrontEndSettings(gain=PLAIN_GAIN, adapt=False, settle=0.5).fit(
        [trace], nominal_arm([trace])
    )
    scaling = Scaling(front.joints)
    limits = np.full(len(front.joints), LIMIT)
    return DelayModel(CollisionAlarm(FittedThresholds(front, scaling, limits, "own"), 1.0), trace)


def lever(joint, length):
    return length * np.eye(6)[joint]


@pytest.mark.parametrize("torque", [30.0, 60.0, 200.0])
def test_a_step_of_torque_is_found_when_the_observer_reaches_the_limit(model, torque):
    times = np.linspace(1e-3, 0.5, 500)
    found = model.delay(TOUCH, lever(1, 0.5), times, np.full(500, torque / 0.5))
    wanted = -math.log(1 - LIMIT / torque) / PLAIN_GAIN + model.alarm.confirmation
    assert found == pytest.approx(wanted, abs=3e-3)


def test_less_than_the_limit_is_not_found_however_long(model):
    times = np.linspace(1e-3, 0.5, 500)
    assert model.delay(TOUCH, lever(1, 0.5), times, np.full(500, 20.0)) == math.inf


def test_a_blow_that_is_over_before_the_observer_rises_is_not_found(model):
    times = np.linspace(1e-3, 0.5, 500)
    short = np.where(times < 2e-3, 100.0, 0.0)
    assert model.delay(TOUCH, lever(1, 0.5), times, short) == math.inf


def test_a_contact_after_the_end_is_not_found(model):
    times = np.linspace(1e-3, 0.5, 500)
    assert model.delay(100.0, lever(1, 0.5), times, np.full(500, 1e3)) == math.inf


def test_detector_and_program_belong_together(model, trace):
    other = Trace(tuple("abcdef"), trace.t, trace.q, trace.qd, trace.current)
    with pytest.raises(MismatchError, match="joints"):
        DelayModel(model.alarm, other)
    still = Trace(trace.joint_names, trace.t, trace.q, trace.qd, 0 * trace.current)
    with pytest.raises(ArgumentError, match="`delay=`"):
        DelayModel(model.alarm, still)


def test_the_detector_decides_in_the_result(model, trace):
    rows = slice(int(np.searchsorted(trace.t, 2.0)), int(np.searchsorted(trace.t, 4.0)), 10)
    part = Program.from_trace(trace)
    program = Program("part", part.joint_names, part.t[rows], part.q[rows], part.qd[rows], trace)
    made = tauguard.speed_limits(
        program, "cura6", detector=model.alarm, regions={"chest": BODY_REGIONS["chest"]},
        options=SpeedOptions(interval=0.3, coarse=6, fine=2, points=2), check=False,
    )  # fmt: skip
    assert made.reacts
    assert made.limits
    for limit in made.limits:
        assert limit.permissible >= limit.undetected * 0.999
        assert limit.delay > model.alarm.confirmation
