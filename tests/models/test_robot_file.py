"""A robot file with other inertial numbers: read back by MuJoCo and Pinocchio's own parsers."""

import numpy as np
import pinocchio as pin
import pytest

from tauguard.models import pin_model
from tauguard.models.robot_file import read_note, write_robot_file

URDF = """<robot name="two"><link name="base"/>
<link name="a"><inertial><mass value="2"/><origin xyz="0 0 .1" rpy="0.3 0 0"/>
<inertia ixx=".02" iyy=".02" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="b"><inertial><mass value="1"/><origin xyz=".1 0 0" rpy="0 0 0"/>
<inertia ixx=".01" iyy=".02" izz=".02" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="tool"><inertial><mass value=".5"/><origin xyz="0 0 0" rpy="0 0 0"/>
<inertia ixx=".01" iyy=".01" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j1" type="revolute"><parent link="base"/><child link="a"/>
<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="9" velocity="9"/></joint>
<joint name="j2" type="revolute"><parent link="a"/><child link="b"/>
<origin xyz="0 0 .3" rpy="0 1 0"/>
<axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="9" velocity="9"/></joint>
<joint name="f" type="fixed"><parent link="b"/><child link="tool"/>
<origin xyz=".2 0 0" rpy="0 0 .5"/>
</joint></robot>"""
MJCF = """<mujoco model="two"><compiler angle="radian"/><worldbody>
<body name="a"><joint name="j1" axis="0 0 1" pos="0.01 0 0"/><geom size=".05" mass="2"/>
<body name="b" pos="0 0 .3"><joint name="j2" axis="0 1 0"/><geom size=".05" mass="1"/>
<body name="tool" pos=".2 0 0"><geom size=".03" mass=".5"/></body></body></body>
</worldbody></mujoco>"""


def body(seed):
    """A box somewhere: an inertia that MuJoCo takes too."""
    rng = np.random.default_rng(seed)
    sides, turn = rng.uniform(0.1, 0.4, 3), pin.exp3(rng.normal(size=3))
    inertia = pin.Inertia.FromBox(rng.uniform(1, 5), *sides)
    return inertia.se3Action(pin.SE3(turn, rng.normal(size=3, scale=0.2)))


def dynamics(model):
    rng = np.random.default_rng(0)
    q, v, a = rng.normal(size=(3, model.nv))
    return pin.rnea(model, model.createData(), q, v, a)


# MuJoCo writes six digits.
@pytest.mark.parametrize(
    ("text", "name", "digits"), [(URDF, "arm.urdf", 1e-9), (MJCF, "arm.xml", 1e-4)]
)
def test_new_numbers_are_those_of_the_file(tmp_path, text, name, digits):
    source, target = tmp_path / name, tmp_path / f"new_{name}"
    source.write_text(text)
    model = pin_model(source)
    rng = np.random.default_rng(1)
    wanted = [body(k) for k in range(2)]
    inertial = np.array([one.toDynamicParameters() for one in wanted])
    note = f'{{"a": "<&>", "b": {rng.random()}}}'
    write_robot_file(source, target, ("j1", "j2"), inertial, note)
    assert read_note(source) is None
    assert read_note(target) == note
    for joint, one in enumerate(wanted, 1):
        model.inertias[joint] = one
    np.testing.assert_allclose(dynamics(pin_model(target)), dynamics(model), rtol=digits)
    write_robot_file(target, target, ("j1", "j2"), inertial, "again")
    assert read_note(target) == "again"


def test_urdf_is_one_for_others_too(tmp_path):
    source, target = tmp_path / "arm.urdf", tmp_path / "new.urdf"
    source.write_text(URDF)
    inertial = np.array([body(k).toDynamicParameters() for k in range(2)])
    write_robot_file(source, target, ("j1", "j2"), inertial, "note")
    theirs = pin.buildModelFromUrdf(str(target))
    np.testing.assert_allclose(dynamics(theirs), dynamics(pin_model(target)), rtol=1e-9)


def test_a_joint_that_is_not_there(tmp_path):
    source = tmp_path / "arm.urdf"
    source.write_text(URDF)
    with pytest.raises(ValueError, match="no joint 'elbow'"):
        write_robot_file(source, tmp_path / "x.urdf", ("elbow",), np.ones((1, 10)), "")
