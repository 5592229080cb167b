"""Logs that cannot be the arm's are refused by name."""

from dataclasses import replace

import numpy as np
import pytest

from tauguard.detectors import ArmModel
from tauguard.detectors.calibration.checks import (
    check_order,
    check_signs,
    check_weight,
    drag,
    torque_per_ampere,
)
from tauguard.detectors.calibration.recording import Recording, cut
from tests.detectors.synthetic_arm import GAIN, nominal, record


@pytest.mark.parametrize("joint", range(3))
def test_a_current_of_the_other_sign_is_named(joint):
    arm, trace = ArmModel(nominal(), GAIN), record(3)
    check_signs(arm, {"log.csv": Recording(trace)})
    sign = np.where(np.arange(3) == joint, -1.0, 1.0)
    with pytest.raises(
        ValueError, match=rf"^log.csv: friction would push {'abc'[joint]}:.*--gains or"
    ):
        check_signs(arm, {"log.csv": Recording(replace(trace, current=trace.current * sign))})
    # A gain of that sign makes up for it.
    told = replace(arm, drive_gain=GAIN * sign)
    check_signs(told, {"log.csv": Recording(replace(trace, current=trace.current * sign))})


@pytest.mark.parametrize("pair", [(0, 1), (0, 2), (1, 2)])
def test_exchanged_joints_are_named(pair):
    arm, traces = ArmModel(nominal(), GAIN), {f"{seed}": record(seed) for seed in (3, 4)}
    check_order(arm, {name: Recording(trace) for name, trace in traces.items()})
    order = [0, 1, 2]
    order[pair[0]], order[pair[1]] = pair[1], pair[0]
    said = f"of {'abc'[pair[0]]} and {'abc'[pair[1]]} seem exchanged"
    for fields in (("current",), ("q", "qd", "current")):
        mixed = {
            name: Recording(
                replace(trace, **{key: getattr(trace, key)[:, order].copy() for key in fields})
            )
            for name, trace in traces.items()
        }
        with pytest.raises(ValueError, match=said):
            check_order(arm, mixed)
        # In 10 s of motion only exchanged currents show; those of joints at rest never do.
        short = {"3": Recording(cut(mixed["3"].trace, slice(0, 1300)))}
        if fields == ("current",):
            with pytest.raises(ValueError, match=said):
                check_order(arm, short)
        else:
            check_order(arm, short)
        moving = np.arange(3) == order[pair[0]]
        check_order(
            arm,
            {
                name: Recording(replace(one.trace, qd=one.trace.qd * moving))
                for name, one in mixed.items()
            },
        )


@pytest.mark.parametrize("joint", range(3))
def test_negated_columns_of_a_joint_are_named(joint):
    arm, trace = ArmModel(nominal(), GAIN), record(3)
    sign = np.where(np.arange(3) == joint, -1.0, 1.0)
    for what, fields in (("currents", ("current",)), ("columns", ("q", "qd", "current"))):
        negated = replace(trace, **{key: getattr(trace, key) * sign for key in fields})
        own = {"log": Recording(negated)}
        if joint == 0 and what == "columns":  # gravity does not act on it: mirrored, it looks alike
            check_order(arm, own)
            continue
        with pytest.raises(ValueError, match=f"the {what} of {'abc'[joint]} seem to have the opp"):
            check_order(arm, own)
        if what == "currents":  # a gain of that sign makes up for it
            check_order(replace(arm, drive_gain=GAIN * sign), own)


def test_joints_that_hardly_move_say_nothing():
    trace = record(3, seconds=8.0)
    still = replace(trace, qd=trace.qd * [1.0, 0.0, 1.0])
    assert np.isnan(drag(nominal(), still, np.ones(3)))[1]
    check_signs(ArmModel(nominal(), GAIN), {"log": Recording(replace(trace, qd=0 * trace.qd))})


@pytest.mark.parametrize("factor", [0.4, 2.5])
def test_an_arm_of_another_weight_is_refused(factor):
    robot, trace = nominal(), record(3)
    check_weight(robot, robot.with_inertial(1.2 * robot.inertial), [trace])
    with pytest.raises(ValueError, match=r"file of another arm.*--torque"):
        check_weight(robot, robot.with_inertial(factor * robot.inertial), [trace])


def test_an_arm_without_gravity_says_nothing():
    robot = replace(nominal(), gravity=np.zeros(3))
    check_weight(robot, robot.with_inertial(5 * robot.inertial), [record(3)])


def test_one_gain_that_nothing_fixes_hides_no_torques():
    torques = replace(record(3), current=record(3).current * GAIN)
    found = np.array([1.1, 0.9, 3.0])  # the last joint carries little
    assert torque_per_ampere(ArmModel(nominal(), found), [torques]) < 1.3
    assert torque_per_ampere(ArmModel(nominal(), GAIN), [record(3)]) > 6.0
