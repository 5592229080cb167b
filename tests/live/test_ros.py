"""JointState messages as samples; rclpy itself is only where ROS 2 is."""

import importlib.util
from types import SimpleNamespace

import pytest

from tauguard.live.ros import RosStream, sample_of


def message(**changed):
    fields = {
        "header": SimpleNamespace(stamp=SimpleNamespace(sec=3, nanosec=500_000_000)),
        "name": ["b", "a", "gripper"],
        "position": [1.0, 2.0, 9.0],
        "velocity": [0.1, 0.2, 9.0],
        "effort": [5.0, 6.0, 9.0],
    }
    return SimpleNamespace(**(fields | changed))


def test_joints_are_taken_by_name():
    sample = sample_of(message(), ("a", "b"), 7)
    assert sample.t == 3.5
    assert sample.q.tolist() == [2.0, 1.0]
    assert sample.qd.tolist() == [0.2, 0.1]
    assert sample.current.tolist() == [6.0, 5.0]
    assert sample.arrived == 7


@pytest.mark.parametrize(
    ("changed", "names", "said"),
    [({}, ("a", "c"), "no c; it has b, a, gripper"), ({"effort": []}, ("a",), "0 numbers in effo")],
)
def test_a_message_that_lacks_something_is_named(changed, names, said):
    with pytest.raises(ValueError, match=said):
        sample_of(message(**changed), names, 0)


@pytest.mark.skipif(importlib.util.find_spec("rclpy") is not None, reason="ROS 2 is there")
def test_without_ros_one_line_says_what_to_do():
    with pytest.raises(ValueError, match="source a ROS 2 installation first, or pipe"):
        RosStream("/joint_states", ("a",), 500.0)
