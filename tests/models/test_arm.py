"""Anybody's arm in a scene: dynamics kept, text that stands alone, unusable files named."""

import mujoco
import numpy as np
import pytest

from tauguard.models import (
    Drive,
    Mismatch,
    SceneSpec,
    Striker,
    compose,
    cura6_drive,
    load_arm,
    pin_model,
    set_payload,
)

from .arms import SEVEN, SLED, TETRAHEDRON


@pytest.fixture
def seven(tmp_path):
    (tmp_path / "tool.obj").write_text(TETRAHEDRON)
    path = tmp_path / "seven.xml"
    path.write_text(SEVEN)
    return path


def mass_matrix_and_bias(model, q, v):
    data = mujoco.MjData(model)
    data.qpos[: len(q)], data.qvel[: len(v)] = q, v
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    return mass[: len(v), : len(v)], data.qfrc_bias[: len(v)]


def test_a_foreign_arm_keeps_its_dynamics(seven):
    """Fusing, inlining and stated inertias change nothing; only the declared rotors come in."""
    original = mujoco.MjModel.from_xml_path(str(seven))
    scene = compose(SceneSpec(arm=str(seven), striker=Striker(), labels=True))
    assert (scene.facts.armature > 0).all()
    rng = np.random.default_rng(1)
    for _ in range(20):
        q, v = rng.uniform(-2, 2, (2, 7))
        mass, bias = mass_matrix_and_bias(scene.model, q, v)
        true_mass, true_bias = mass_matrix_and_bias(original, q, v)
        rotors = np.diag(scene.facts.armature)
        np.testing.assert_allclose(mass, true_mass + rotors, rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(bias, true_bias, rtol=1e-9, atol=1e-11)


def test_a_foreign_arm_says_what_it_is(seven):
    scene = compose(SceneSpec(arm=str(seven), payload=True))
    assert len(scene.joint_names) == len(scene.link_bodies) == 7
    assert scene.joint_names[-1] == "last"
    np.testing.assert_allclose(scene.home, [0, 0.5, 0, -1, 0, 0.5, 0.1])
    np.testing.assert_allclose(scene.drive.torque_limit[[0, -1]], [80, 7])
    assert np.isfinite(scene.drive.torque_limit).all()
    assert "none in the file" in scene.facts.sources["torque_limit"]
    assert (scene.model.nu, scene.model.nkey) == (0, 0)
    set_payload(scene.model, mujoco.MjData(scene.model), scene.payload_body, 1.0)
    assert [scene.model.sensor(i).name for i in range(7)] == [
        f"contact_link{i}" for i in range(1, 8)
    ]
    bodies = scene.model.geom_bodyid[scene.model.geom_contype > 0]
    assert set(scene.link_bodies) <= set(bodies), "every link can be struck"


def test_its_text_needs_no_file(seven):
    scene = compose(SceneSpec(arm=str(seven), striker=Striker()))
    (seven.parent / "tool.obj").unlink()
    again = mujoco.MjModel.from_xml_string(scene.xml)
    np.testing.assert_array_equal(again.body_inertia, scene.model.body_inertia)
    np.testing.assert_allclose(again.mesh_vert, scene.model.mesh_vert, atol=1e-7)
    assert pin_model(scene.arm_xml).nq == 7


def test_a_foreign_arm_can_be_perturbed(seven):
    nominal = compose(SceneSpec(arm=str(seven)))
    scene = compose(SceneSpec(arm=str(seven), mismatch=Mismatch(3)))
    ratio = scene.model.body_mass[scene.link_bodies] / nominal.model.body_mass[scene.link_bodies]
    assert (np.abs(ratio - 1) <= 0.05 + 1e-9).all()
    assert np.unique(ratio).size == 7


URDF = """<robot name="two"><link name="base"/>
  <link name="a"><inertial><origin xyz="0 0 0.1"/><mass value="2"/>
    <inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="b"><inertial><origin xyz="0 0.05 0.1" rpy="0.3 0 0"/><mass value="1"/>
    <inertia ixx="0.01" iyy="0.02" izz="0.015" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="turn" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
    <origin xyz="0 0 0.2" rpy="0.2 0 0"/><limit effort="30" velocity="2"/></joint>
  <joint name="bend" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>
    <origin xyz="0 0 0.3"/><limit effort="20" velocity="2" lower="-2" upper="2"/></joint></robot>"""


def test_urdf_with_a_continuous_joint(tmp_path):
    path = tmp_path / "two.urdf"
    path.write_text(URDF)
    assert pin_model(path).nq == 2
    scene = compose(SceneSpec(arm=str(path), striker=Striker()))
    assert scene.joint_names == ("turn", "bend")
    np.testing.assert_allclose(scene.drive.torque_limit, [30, 20])
    nominal = pin_model(scene.arm_xml)
    np.testing.assert_allclose(nominal.inertias[2].mass, 1.0)


def test_base_pose_moves_the_arm_and_what_the_observer_believes():
    pose = np.array([[0, -1, 0, 0.3], [0, 0, -1, 0.1], [1, 0, 0, 0.9], [0, 0, 0, 1.0]])
    plain, moved = compose(SceneSpec()), compose(SceneSpec(base_pose=pose, payload=True))
    q = np.array(plain.home)
    where = []
    for scene in (plain, moved):
        data = mujoco.MjData(scene.model)
        data.qpos[scene.qpos_adr] = q
        mujoco.mj_kinematics(scene.model, data)
        site = data.site("flange")
        where.append((site.xpos.copy(), site.xmat.reshape(3, 3).copy()))
    np.testing.assert_allclose(pose[:3, :3] @ where[0][0] + pose[:3, 3], where[1][0], atol=1e-12)
    np.testing.assert_allclose(pose[:3, :3] @ where[0][1], where[1][1], atol=1e-12)
    believed = pin_model(moved.arm_xml)
    data = believed.createData()
    _, bias = mass_matrix_and_bias(pin_free(moved), q, np.zeros(6))
    import pinocchio as pin

    np.testing.assert_allclose(pin.computeGeneralizedGravity(believed, data, q), bias, atol=1e-10)


def pin_free(scene):
    """The nominal arm alone, compiled by MuJoCo."""
    return mujoco.MjModel.from_xml_string(scene.arm_xml)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>", "no joints; expected an arm"),
        (
            "<mujoco><worldbody><body name='k'><joint type='ball'/><geom size='.1'/></body>"
            "</worldbody></mujoco>",
            "body 'k': expected one hinge or slide joint",
        ),
        (
            "<mujoco><worldbody><body name='l'><joint/><geom size='.1'/></body>"
            "<body name='r'><joint/><geom size='.1'/></body></worldbody></mujoco>",
            r"branches into l .*; r .*; expected one serial chain.*Name those of the arm",
        ),
        (
            "<mujoco><worldbody><body name='w'><joint name='wheel'/><geom size='.1'/></body>"
            "<body name='t'><joint name='lift'/><geom size='.1'/>"
            "<body name='h'><joint name='head'/><geom size='.1'/></body>"
            "<body name='a'><joint name='a1'/><geom size='.1'/>"
            "<body name='b'><joint name='a2'/><geom size='.1'/>"
            "<body name='f'><joint name='f1'/><geom size='.1'/></body>"
            "<body name='g'><joint name='f2'/><geom size='.1'/></body></body></body></body>"
            "</worldbody></mujoco>",
            r"`arm_joints=.lift\.\.a2.` ",
        ),
        ("<mujoco><worldbody><body>", "arm "),
    ],
    ids=["no joints", "ball joint", "two arms", "wheel, head and fingers", "no XML"],
)
def test_unusable_arms_are_named(tmp_path, text, message):
    path = tmp_path / "arm.xml"
    path.write_text(text)
    with pytest.raises(ValueError, match=message):
        load_arm(str(path))


def test_a_missing_arm_lists_what_works():
    with pytest.raises(FileNotFoundError, match=r"expected cura6, .*ur5e.* an MJCF or URDF file"):
        compose(SceneSpec(arm="cura7"))


def test_a_drive_of_other_joints_is_named(tmp_path):
    path = tmp_path / "sled.xml"
    path.write_text(SLED.format(mass=3))
    with pytest.raises(ValueError, match="of 6 joints, but the arm has 1: rail"):
        compose(SceneSpec(arm=str(path), drive=cura6_drive()))
    assert compose(SceneSpec(arm=str(path), drive=Drive.ideal(np.ones(1)))).drive.gain == [10]
