"""A robot described once: what is stated is used, what is not is derived and says so."""

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tauguard.models import (
    ROBOTS,
    LeftOver,
    Robot,
    RobotDrive,
    SceneSpec,
    compose,
    cura6_drive,
    load_arm,
    pin_model,
)
from tauguard.models.drive_text import drive_of, drive_text
from tauguard.models.robot import bodies_file
from tests.models.arms import random_arm


@pytest.fixture
def arm(tmp_path):
    def write(seed, gripper="none"):
        path = tmp_path / f"arm{seed}{gripper}.xml"
        path.write_text(random_arm(seed, gripper))
        return path

    return write


@pytest.mark.parametrize("seed", range(12))
def test_an_unseen_arm_gets_what_its_file_leaves_open(arm, seed):
    scene = compose(SceneSpec(arm=str(arm(seed))))
    facts, model = scene.facts, scene.model
    joints = [model.joint(name).id for name in facts.joints]
    limited = model.jnt_limited[joints].astype(bool)
    low, high = model.jnt_range[joints].T
    assert ((facts.home >= low) & (facts.home <= high))[limited].all()
    assert (facts.armature > 0).all()
    np.testing.assert_array_equal(model.dof_armature[scene.dof_adr], facts.armature)
    assert np.isfinite(facts.drive.torque_limit).all()
    for part in ("armature", "home", "torque_limit", "max_speed", "bandwidth", "tool", "drive"):
        assert facts.sources[part], part
    friction = facts.nominal.friction
    np.testing.assert_allclose(facts.damping, model.dof_damping[scene.dof_adr])
    if facts.friction_loss.any():
        np.testing.assert_allclose(friction.coulomb, facts.friction_loss)
        np.testing.assert_allclose(friction.viscous, facts.damping)


@pytest.mark.parametrize("gripper", ["fingers", "jaw"])
@pytest.mark.parametrize("kept", ["weld", "passive"])
@pytest.mark.parametrize("described", [False, True])
def test_a_gripper_is_welded_or_left_passive(arm, gripper, kept, described, tmp_path):
    path = arm(3, gripper)
    bare = load_arm(str(arm(3)))
    robot = tmp_path / "arm.toml"
    robot.write_text(f'file = "{path}"\ngripper = "{kept}"\n')
    known = str(robot) if described else Robot(str(path), gripper=kept)
    scene = compose(SceneSpec(arm=known, payload=True))
    assert scene.joint_names == bare.joints
    assert len(scene.facts.gripper) == (2 if gripper == "fingers" else 1)
    assert scene.model.njnt == len(bare.joints) + (len(scene.facts.gripper) * (kept == "passive"))
    nominal = pin_model(scene.arm_model)
    assert nominal.nq == len(bare.joints)
    whole = mujoco.MjModel.from_xml_path(str(path))
    got = sum(inertia.mass for inertia in nominal.inertias) - nominal.inertias[0].mass
    assert got == pytest.approx(whole.body_mass.sum(), rel=1e-9), "the gripper's mass is known"


def test_other_shapes_name_the_way_out(tmp_path):
    path = tmp_path / "two.xml"
    body = (
        "<body name='{0}'><joint name='{0}1'/><geom size='.1'/><body pos='0 0 .3'>"
        "<joint name='{0}2' axis='0 1 0'/><geom size='.1'/></body></body>"
    )
    both = body.format("l") + body.format("r")
    path.write_text(f"<mujoco><worldbody>{both}</worldbody></mujoco>")
    with pytest.raises(ValueError, match=r"l1, l2.*r1, r2.*joints=") as error:
        load_arm(str(path))
    assert "\n" not in str(error.value)
    assert load_arm(Robot(str(path), joints=("l1", "l2"))).joints == ("l1", "l2")
    with pytest.raises(ValueError, match="no joint 'x'; the file has l1, l2, r1, r2"):
        load_arm(Robot(str(path), joints=("x",)))


def test_a_toml_file_describes_a_robot(arm, tmp_path):
    path = arm(4)
    names = load_arm(str(path)).joints
    text = f"""
file = "{path.name}"
home = {[0.2] * len(names)}
max_speed = 1.5
bandwidth = 20
[drive]
gear = 100
torque_constant = 0.1
rotor_inertia = 2e-5
coulomb = 1.0
"""
    description = tmp_path / "arm.toml"
    description.write_text(text)
    facts = load_arm(str(description)).facts
    np.testing.assert_allclose(facts.drive.gain, 10.0)
    np.testing.assert_allclose(facts.armature, 0.2)
    np.testing.assert_allclose(facts.max_speed, 1.5)
    np.testing.assert_allclose(facts.drive.friction.coulomb, 1.0)
    assert facts.sources["max_speed"] == facts.sources["home"] == "given"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("home = [0]", "no file"),
        ('file = "a.xml"\nhoem = [0]', "no key 'hoem'; expected some of file"),
        ('file = "a.xml"\n[drive]\ngear = -1', "drive.gear -1.0: expected above 0"),
        ('file = "a.xml"\n[drive]\nratio = 1', "drive: no key 'ratio'"),
        ('file = "a.xml"\nmax_speed = "fast"', "max_speed 'fast': expected a number"),
        ('file = "a.xml"\ngripper = "glued"', "gripper 'glued': expected one of weld, passive"),
        ("file =", "arm.toml"),
    ],
)
def test_a_wrong_description_is_named(tmp_path, text, message):
    path = tmp_path / "arm.toml"
    path.write_text(text)
    with pytest.raises(ValueError, match=message) as error:
        Robot.from_toml(path)
    assert "\n" not in str(error.value)


def test_stated_rows_have_a_number_a_joint(arm):
    with pytest.raises(ValueError, match="max_speed: 2 numbers, expected one or"):
        load_arm(Robot(str(arm(5)), max_speed=(1.0, 2.0)))
    with pytest.raises(ValueError, match=r"drive\.gear: 3 numbers"):
        load_arm(Robot(str(arm(5)), drive=RobotDrive(gear=(1.0, 2.0, 3.0))))


def test_every_known_arm_names_its_sources():
    for name, row in ROBOTS.items():
        stated = {
            key
            for key, value in vars(row.robot).items()
            if key != "file" and value != getattr(Robot(file=name), key)
        }
        assert stated == set(row.sources), name
        assert row.own or row.urdf or row.menagerie


def test_a_known_arm_without_its_model_says_what_to_install(monkeypatch):
    monkeypatch.setattr("tauguard.models.known_robots.robot_data_folders", list)
    monkeypatch.setattr("tauguard.models.known_robots.menagerie_file", lambda name: None)
    with pytest.raises(FileNotFoundError, match=r"extra `arms`.*or give a file"):
        load_arm("xarm7")


@pytest.mark.parametrize(("factor", "marked"), [(0.2, True), (1.5, False), (40.0, True)])
def test_torque_limits_that_cannot_be_are_marked(tmp_path, factor, marked):
    """Two links of 2 kg, 0.4 m long: gravity asks 2 g (0.2 + 0.6) = 15.7 N m of the first."""
    limit = factor * 2 * 9.81 * (0.2 + 0.6)
    link = '<geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.01" mass="2"/>'
    joint = f'<joint name="j{{}}" axis="0 1 0" actuatorfrcrange="{-limit} {limit}"/>'
    path = tmp_path / "two.xml"
    path.write_text(
        f'<mujoco><worldbody><body name="a">{joint.format(1)}{link}<body name="b" pos="0.4 0 0">'
        f"{joint.format(2)}{link}</body></body></worldbody></mujoco>"
    )
    source = load_arm(str(path)).facts.sources["torque_limit"]
    assert ("implausible" in source) == marked
    assert bool(re.search("largest gravity torque, 1[456] N m at j1", source)) == marked
    assert (
        "implausible"
        not in load_arm(Robot(str(path), torque_limit=20.0)).facts.sources["torque_limit"]
    )


def test_losses_like_the_cura6s_are_shares_of_the_limits(arm):
    own, like = cura6_drive(), load_arm(Robot(str(arm(5)), drive=RobotDrive(like="cura6"))).facts
    drive, shares = like.drive, own.friction.coulomb / own.torque_limit
    quiet = (like.damping == 0) & (like.friction_loss == 0)
    given = drive.friction.coulomb / drive.torque_limit
    assert ((given >= shares.min()) & (given <= shares.max()))[quiet].all()
    assert (given[~quiet] == 0).all()
    noise = drive.sensors.current_noise / drive.current_limit
    assert noise == pytest.approx(np.mean(own.sensors.current_noise / own.current_limit))
    assert drive.ripple.amplitude.shape == (len(like.joints), len(own.ripple.cycles))
    assert "fractions of limits" in like.sources["drive"]
    stated = Robot(str(arm(5)), drive=RobotDrive(like="cura6", coulomb=0.5))
    assert load_arm(stated).facts.drive.friction.coulomb == pytest.approx(0.5)
    with pytest.raises(ValueError, match=r'drive\.like .*expected "cura6"'):
        RobotDrive(like="ur5")


def test_the_bodies_of_a_description_are_its_file(tmp_path, arm):
    bodies, path = arm(4), tmp_path / "r.toml"
    path.write_text(f'file = "{bodies.name}"\n')
    assert bodies_file(path) == bodies
    assert bodies_file(bodies) == bodies
    assert bodies_file(Path("panda")).name == "panda.xml"
    assert bodies_file(Path("no-such-arm")) == Path("no-such-arm")
    path.write_text('file = "gone.xml"\n')
    with pytest.raises(ValueError, match=r"gone\.xml.*no such file"):
        bodies_file(path)


def test_a_folder_does_not_hide_the_arm_of_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("panda").mkdir()  # of logs
    assert bodies_file(Path("panda")).name == "panda.xml"


def test_an_identified_drive_has_friction_ripple_and_sensors_of_its_own(tmp_path, arm):
    path, n = tmp_path / "r.toml", len(load_arm(str(arm(4))).joints)
    rows = np.full((200, n), 0.3)
    LeftOver(125.0, np.zeros(200, int), 0 * rows, rows).write(tmp_path / "left.csv")
    path.write_text(f"""
file = "{arm(4)}"
source = "identified from a.csv"
[drive]
gain = {[12.0] * n}
coulomb = 2.0
static = 2.5
stribeck_velocity = 0.1
load = {[0.01] * n}
presliding = 1e-3
[drive.ripple]
cycles = [2.0]
amplitude = {[[0.2]] * n}
phase = {[[0.0]] * n}
[drive.sensors]
current_noise = 0.01
rate = 125
left_over = "left.csv"
""")
    facts = load_arm(str(path)).facts
    drive = facts.drive
    assert facts.sources["drive"] == "identified from a.csv; no lag"
    np.testing.assert_array_equal(drive.gain, 12.0)
    np.testing.assert_allclose(drive.friction.bristle_stiffness, 2000.0)
    np.testing.assert_array_equal(drive.friction.static, 2.5)
    # Two cycles a turn are at their first peak after an eighth of it: sin(2 pi / 4) = 1.
    np.testing.assert_allclose(drive.ripple.at(np.full((1, n), np.pi / 4)), 0.2)
    # The left-over errors are read from the file beside the description, and no part of its text.
    np.testing.assert_allclose(drive.sensors.left_over.current, 0.3)
    assert drive.sensors.rate == 125
    again = drive_of(drive_text(drive))
    assert again.sensors.rate == 125
    assert again.sensors.left_over is None


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            "gain = 1.0\ntorque_constant = 0.1",
            "drive.torque_constant: give one of them",
        ),
        ("[drive.ripple]\ncycles = [1.0]", "drive.ripple: missing"),
        ("[drive.sensors]\nlag = 1.0", "drive.sensors: no key 'lag'"),
        ("[drive.sensors]\ncurrent_noise = -1.0", "expected 0 or more"),
        (
            "[drive.ripple]\ncycles = [1.0]\namplitude = [[1.0, 2.0]]\nphase = [[0.0]]",
            "amplitude: expected 1 numbers per joint",
        ),
    ],
)
def test_an_identified_drive_that_cannot_be_is_refused(tmp_path, text, says):
    path = tmp_path / "r.toml"
    path.write_text(f'file = "a.xml"\n[drive]\n{text}\n')
    with pytest.raises(ValueError, match=says):
        Robot.from_toml(path)
