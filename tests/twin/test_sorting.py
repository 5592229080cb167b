"""Logs of two arms, and of loads that nobody told, are named."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from tauguard.detectors import ArmModel
from tauguard.detectors.calibration.recording import Load, Recording
from tauguard.twin.sorting import odd_logs
from tests.detectors.synthetic_arm import COULOMB, GAIN, ROTOR, VISCOUS, nominal, record, true_model


def of_another(seed, heavier=1.4):
    """The same motion by an arm of other masses and friction."""
    trace, model = record(seed), true_model()
    for joint in range(1, model.njoints):
        body = model.inertias[joint]
        model.inertias[joint] = pin.Inertia(heavier * body.mass, body.lever, heavier * body.inertia)
    model.armature, data = ROTOR, model.createData()
    qdd = np.gradient(trace.qd, trace.t, axis=0)
    rows = zip(trace.q, trace.qd, qdd, strict=True)
    tau = np.array([pin.rnea(model, data, *row) for row in rows])
    tau += 1.5 * (COULOMB * np.tanh(trace.qd / 0.02) + VISCOUS * trace.qd)
    return replace(trace, current=tau / GAIN)


def odd(kinds):
    """Of a log a letter: a, the arm; b, another one; l, the arm with 2 kg; u, so and said so."""
    make = {"a": record, "b": of_another, "l": lambda k: record(k, load=2.0)}
    logs = [
        Recording(make[kind.replace("u", "l")](k), None if kind == "u" else Load())
        for k, kind in enumerate(kinds)
    ]
    return odd_logs(ArmModel(nominal(), GAIN), [f"{kind}{k}" for k, kind in enumerate(kinds)], logs)


@pytest.mark.parametrize("kinds", ["a", "aa", "aaaa", "aaau"])
def test_logs_of_one_arm_are_kept(kinds):
    assert odd(kinds) == []


@pytest.mark.parametrize(("kinds", "names"), [("aabb", "b2, b3"), ("alaal", "l1, l4")])
def test_logs_of_two_arms_or_loads_are_refused_by_name(kinds, names):
    with pytest.raises(ValueError, match="do not predict each other") as error:
        odd(kinds)
    assert names in str(error.value)


@pytest.mark.parametrize("kinds", ["aaab", "alaa"])
def test_one_log_that_differs_is_found(kinds):
    assert odd(kinds) == [max(kinds.find("b"), kinds.find("l"))]
