"""Logs that cannot be the arm's are refused by name."""

from dataclasses import replace

import numpy as np
import pytest

from tauguard.detectors import ArmModel
from tauguard.detectors.calibration.checks import (
    drag,
    gravity_finding,
    sign_findings,
    torque_per_ampere,
    unit_finding,
)
from tauguard.detectors.calibration.column_order import order_findings
from tauguard.detectors.calibration.recording import Recording, cut
from tests.detectors.synthetic_arm import GAIN, nominal, record

GROUPS = ("q", "qd", "current")


def changed(trace, order, signs, fields):
    """A recording with the columns of ``fields`` in another order and with other signs."""
    columns = {key: getattr(trace, key)[:, order] * signs for key in fields}
    return Recording(replace(trace, **columns))


@pytest.mark.parametrize("joint", range(3))
def test_a_current_of_the_other_sign_is_named(joint):
    arm, trace = ArmModel(nominal(), GAIN), record(3)
    assert not sign_findings(arm, {"log.csv": Recording(trace)})
    sign = np.where(np.arange(3) == joint, -1.0, 1.0)
    wrong = {"log.csv": changed(trace, range(3), sign, ("current",))}
    (finding,) = sign_findings(arm, wrong)
    assert finding.where == ("log.csv", "abc"[joint])
    assert finding.text.startswith(f"log.csv: friction would push {'abc'[joint]}:")
    assert finding.accept == ""
    # A gain of that sign makes up for it.
    assert not sign_findings(replace(arm, drive_gain=GAIN * sign), wrong)


@pytest.mark.parametrize("pair", [(0, 1), (0, 2), (1, 2)])
def test_exchanged_joints_are_named(pair):
    arm, traces = ArmModel(nominal(), GAIN), {f"{seed}": record(seed) for seed in (3, 4)}
    assert not order_findings(arm, {name: Recording(trace) for name, trace in traces.items()})
    order = [0, 1, 2]
    order[pair[0]], order[pair[1]] = pair[1], pair[0]
    names = tuple("abc"[k] for k in pair)
    for fields in (("current",), GROUPS):
        mixed = {name: changed(trace, order, 1, fields) for name, trace in traces.items()}
        (finding,) = order_findings(arm, mixed)
        assert finding.where == names
        assert finding.accept == "order"
        # In 10 s of motion only exchanged currents show; those of joints at rest never do.
        short = {"3": Recording(cut(mixed["3"].trace, slice(0, 1300)))}
        found = [one.where for one in order_findings(arm, short)]
        assert found == ([names] if fields == ("current",) else [])
        moving = np.arange(3) == order[pair[0]]
        resting = {n: changed(one.trace, range(3), moving, ("qd",)) for n, one in mixed.items()}
        assert not order_findings(arm, resting)


@pytest.mark.parametrize("joint", range(3))
def test_negated_columns_of_a_joint_are_named(joint):
    arm, trace = ArmModel(nominal(), GAIN), record(3)
    sign = np.where(np.arange(3) == joint, -1.0, 1.0)
    for what, fields in (("currents", ("current",)), ("columns", GROUPS)):
        own = {"log": changed(trace, range(3), sign, fields)}
        if joint == 0 and what == "columns":  # gravity does not act on it: mirrored, it looks alike
            assert not order_findings(arm, own)
            continue
        (finding,) = order_findings(arm, own)
        assert finding.text.startswith(f"the {what} of {'abc'[joint]} seem to have the opposite")
        if what == "currents":  # a gain of that sign makes up for it
            assert not order_findings(replace(arm, drive_gain=GAIN * sign), own)


@pytest.mark.parametrize(("pair", "joint"), [((0, 1), 2), ((1, 2), 0), ((0, 2), 1)])
def test_exchanged_currents_and_a_negated_one_are_named_together(pair, joint):
    arm, order = ArmModel(nominal(), GAIN), [0, 1, 2]
    order[pair[0]], order[pair[1]] = pair[1], pair[0]
    sign = np.where(np.arange(3) == joint, -1.0, 1.0)
    logs = {str(k): changed(record(k), order, sign, ("current",)) for k in (3, 4)}
    where = {finding.where for finding in order_findings(arm, logs)}
    assert where == {tuple("abc"[k] for k in pair), ("abc"[joint],)}


@pytest.mark.parametrize("scale", [1.0, 3.0, 1000.0])
def test_currents_in_milliamperes_are_named(scale):
    arm, trace = ArmModel(nominal(), GAIN), record(3)
    finding = unit_finding(arm, [replace(trace, current=scale * trace.current)])
    assert (finding is not None) == (scale == 1000.0)
    assert finding is None or '`mend="mA"`' in finding.text


def test_joints_that_hardly_move_say_nothing():
    trace = record(3, seconds=8.0)
    still = replace(trace, qd=trace.qd * [1.0, 0.0, 1.0])
    assert np.isnan(drag(nominal(), still, np.ones(3)))[1]
    resting = {"log": Recording(replace(trace, qd=0 * trace.qd))}
    assert not sign_findings(ArmModel(nominal(), GAIN), resting)


@pytest.mark.parametrize("factor", [0.4, 2.5])
def test_an_arm_of_another_weight_is_refused(factor):
    robot, trace = nominal(), record(3)
    assert gravity_finding(robot, robot.with_inertial(1.2 * robot.inertial), [trace]) is None
    finding = gravity_finding(robot, robot.with_inertial(factor * robot.inertial), [trace])
    assert "file of another arm" in finding.text
    assert finding.accept == "gravity"


def test_torques_that_pull_with_gravity_are_named():
    robot = nominal()
    finding = gravity_finding(robot, robot.with_inertial(-robot.inertial), [record(3)])
    assert "pull with gravity" in finding.text


def test_an_arm_without_gravity_says_nothing():
    robot = replace(nominal(), gravity=np.zeros(3))
    heavy = robot.with_inertial(5 * robot.inertial)
    assert gravity_finding(robot, heavy, [record(3)]) is None


def test_one_gain_that_nothing_fixes_hides_no_torques():
    torques = replace(record(3), current=record(3).current * GAIN)
    found = np.array([1.1, 0.9, 3.0])  # the last joint carries little
    assert torque_per_ampere(ArmModel(nominal(), found), [torques]) < 1.3
    assert torque_per_ampere(ArmModel(nominal(), GAIN), [record(3)]) > 6.0
