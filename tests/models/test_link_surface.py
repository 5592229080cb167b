import re

import mujoco
import numpy as np
import pytest

from tauguard.models import arm_surface, cura6, link_surface, pin_model

ARM = """<mujoco><worldbody><body name="a" pos="0.1 0.2 0.3" euler="20 30 40"><joint name="j"
 pos="0.05 0 0"/><geom type="sphere" size="0.1" pos="0.2 0 0"/>
 <body name="welded" pos="0.2 0.1 0"><geom type="box" size="0.05 0.02 0.03"/></body>
 <geom type="sphere" size="5" contype="0" conaffinity="0"/></body></worldbody></mujoco>"""


def test_points_are_on_the_capsule_of_the_last_link_and_normals_point_out():
    surface = link_surface(cura6.arm_xml(), points=80)
    rows = surface.link == 5
    point, normal = surface.point[rows], surface.normal[rows]
    axis = np.column_stack([np.zeros(80), np.clip(point[:, 1], -0.015, 0.0), np.zeros(80)])
    assert np.abs(np.linalg.norm(point - axis, axis=1) - 0.045).max() < 1e-12
    assert np.abs(axis + 0.045 * normal - point).max() < 1e-12


def test_points_are_spread_evenly_over_a_sphere():
    xml = '<mujoco><worldbody><body><joint/><geom size="1"/></body></worldbody></mujoco>'
    point = link_surface(xml, points=2000).point
    # Archimedes: each coordinate of a uniform point on the unit sphere is uniform on [-1, 1].
    for coordinate in point.T:
        counts = np.histogram(coordinate, 10, (-1, 1))[0]
        assert ((counts - 200.0) ** 2 / 200.0).sum() < 27.9  # chi square, 9 degrees, 0.1 %


def test_frames_are_those_of_pinocchio_and_hidden_or_untouchable_surfaces_are_left_out():
    import pinocchio as pin

    surface = link_surface(ARM, points=300)
    model = pin_model(ARM)
    data = model.createData()
    pin.forwardKinematics(model, data, np.zeros(1))
    world = surface.point @ data.oMi[1].rotation.T + data.oMi[1].translation
    mj = mujoco.MjModel.from_xml_string(ARM)
    placed = mujoco.MjData(mj)
    mujoco.mj_kinematics(mj, placed)
    sphere, box = [(placed.geom_xpos[g], placed.geom_xmat[g].reshape(3, 3)) for g in (0, 2)]
    to_sphere = np.linalg.norm(world - sphere[0], axis=1) - 0.1
    local = np.abs((world - box[0]) @ box[1]) - np.array([0.05, 0.02, 0.03])
    to_box = local.max(axis=1)
    on_sphere, on_box = np.abs(to_sphere) < 1e-12, np.abs(to_box) < 1e-12
    assert (on_sphere | on_box).all()
    assert on_sphere.any()
    assert on_box.any()
    assert (to_sphere[on_box] > -1e-12).all()
    assert (to_box[on_sphere] > -1e-12).all()


def test_some_links_alone():
    whole = link_surface(cura6.arm_xml(), points=20)
    part = whole.only((6, 2, 2))
    assert set(part.link.tolist()) == {1, 5}
    np.testing.assert_array_equal(part.point[part.link == 5], whole.point[whole.link == 5])
    with pytest.raises(ValueError, match=r"links \[2, 7\]: expected some of \[1, 2, 3, 4, 5, 6\]"):
        whole.only((2, 7))


def test_bad_input_is_named():
    with pytest.raises(ValueError, match="no link has collision geometry"):
        link_surface(
            '<mujoco><worldbody><body><joint/><inertial pos="0 0 0" mass="1"'
            ' diaginertia="1 1 1"/></body></worldbody></mujoco>'
        )
    with pytest.raises(ValueError, match="points 0"):
        link_surface(cura6.arm_xml(), points=0)


URDF = """<robot name="arm"><link name="base"/>
  <link name="a"><inertial><mass value="2"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0"
    iyz="0"/></inertial>
    <collision><geometry><mesh filename="package://gone/a.stl"/></geometry></collision></link>
  <link name="b"><inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0"
    iyz="0"/></inertial>
    <collision><origin xyz="0 0 .2"/><geometry><box size=".1 .1 .4"/></geometry></collision></link>
  <joint name="j1" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="50" velocity="2"/></joint>
  <joint name="j2" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>
    <origin xyz="0 0 .4"/><limit lower="-3" upper="3" effort="50" velocity="2"/></joint>
</robot>"""


def test_the_surface_of_a_urdf_is_that_of_its_shapes_and_a_capsule_where_there_are_none(tmp_path):
    (tmp_path / "arm.urdf").write_text(URDF)
    surface, sticks = arm_surface(tmp_path / "arm.urdf", ("j1", "j2"), points=200)
    assert sticks == ("a",)
    on_a, on_b = (surface.point[surface.link == k] for k in (0, 1))
    assert len(on_a) == len(on_b) == 200
    away = np.abs(on_b - [0, 0, 0.2]) - [0.05, 0.05, 0.2]
    np.testing.assert_allclose(away.max(axis=1), 0, atol=1e-6)
    along = np.clip(on_a[:, 2:], 0, 0.4) * [0, 0, 1]
    np.testing.assert_allclose(np.linalg.norm(on_a - along, axis=1), 0.05, atol=1e-3)


def test_joints_that_the_surface_is_not_of_are_named(tmp_path):
    (tmp_path / "arm.urdf").write_text(URDF)
    one, sticks = arm_surface(tmp_path / "arm.urdf", ("j2",), points=20)
    assert set(one.link) == {0}
    assert sticks == ()
    (tmp_path / "bare.urdf").write_text(re.sub(r"<collision>.*?</collision>", "", URDF))
    with pytest.raises(ValueError, match="the last link, b, has no shape"):
        arm_surface(tmp_path / "bare.urdf", ("j1", "j2"))
    with pytest.raises(ValueError, match="no joint 'j3'"):
        arm_surface(tmp_path / "arm.urdf", ("j1", "j3"))
    with pytest.raises(ValueError, match="base to tip, are j1, j2; expected j2, j1"):
        arm_surface(tmp_path / "arm.urdf", ("j2", "j1"))
