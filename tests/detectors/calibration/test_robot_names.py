"""A robot file that is another arm's is refused by name."""

from dataclasses import replace

import pytest

from tauguard.detectors.calibration.robot_names import robot_name_finding
from tests.detectors.synthetic_arm import record


def of(preset):
    return [replace(record(0, 1.0), meta={"columns": preset} if preset else {})]


@pytest.mark.parametrize(
    ("name", "text", "preset", "named"),
    [
        ("ur3.urdf", '<robot name="ur3">', "ur5", "ur3.urdf is the file of a ur3"),
        ("arm.urdf", '<robot\n name="ur10e_robot" >', "ur5", "the file of a ur10e"),
        ("ur5e.calibrated.urdf", "<robot>", "ur5", "the columns are those of a ur5"),
        ("arm.xml", '<mujoco model="UR3">', "ur5", "file of a ur3"),
    ],
)
def test_the_file_of_another_ur_is_refused(tmp_path, name, text, preset, named):
    path = tmp_path / name
    path.write_text(text)
    text = robot_name_finding(path, of(preset)).text
    assert "give the ur5's file" in text
    assert named in text


@pytest.mark.parametrize(
    ("name", "preset"),
    [
        ("ur5.urdf", "ur5"),
        ("cell_ur5_left.urdf", "ur5"),
        ("ur10e.urdf", "ur_rtde"),
        ("ur10e.urdf", None),
        ("arm.urdf", "ur5"),
        ("blur5x.urdf", "ur3"),
    ],
)
def test_other_names_say_nothing(tmp_path, name, preset):
    path = tmp_path / name
    path.write_text("<robot>")
    assert robot_name_finding(path, of(preset)) is None
