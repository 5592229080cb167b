"""Pushes at the last link reach the joints as Pinocchio's Jacobian says."""

import numpy as np
import pinocchio as pin
import pytest

from tauguard.detectors.evaluation.semi_real import Push, add_torque, push_torque
from tauguard.models import pin_model
from tests.detectors.synthetic_arm import GAIN, XML, nominal, record


def test_push_is_the_force_through_the_jacobian():
    trace = record(2, seconds=12.0)
    push = Push(10.0, 0.6, (30.0, -20.0, 10.0), point=(0.1, 0.02, -0.03))
    torque = push_torque(nominal(), trace, push)
    model = pin_model(XML)
    for k in (1005, 1030, 1055):
        at = pin.SE3(np.eye(3), np.array(push.point))
        frame = model.addFrame(pin.Frame(f"p{k}", 3, 0, at, pin.FrameType.OP_FRAME))
        jacobian = pin.computeFrameJacobian(
            model, model.createData(), trace.q[k], frame, pin.LOCAL_WORLD_ALIGNED
        )[:3]
        phase = np.sin(np.pi * (trace.t[k] - 10.0) / 0.6)
        assert torque[k] == pytest.approx(phase * jacobian.T @ np.array(push.force), abs=1e-9)
    assert not torque[(trace.t < 10.0) | (trace.t > 10.6)].any()
    struck = add_torque(trace, GAIN, torque)
    assert struck.current == pytest.approx(trace.current - torque / GAIN)
    assert struck.meta["collisions"] == "semi-real"


def test_push_without_duration_is_refused():
    with pytest.raises(ValueError, match="more than 0 s"):
        push_torque(nominal(), record(2, seconds=12.0), Push(1.0, 0.0, (1.0, 0.0, 0.0)))
