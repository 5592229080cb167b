"""The package's own arms stand where their makers' parameters say."""

import mujoco
import numpy as np
import pytest

from tauguard.models import SceneSpec, compose, load_arm

PI = np.pi
#: Of each arm, modified (Craig) or classic parameters: a, alpha, d. Universal Robots: UR5e. Franka
#: Emika: FCI. KUKA: sums of lengths.
UR5E = [(0, PI / 2, 0.1625), (-0.425, 0, 0), (-0.3922, 0, 0), (0, PI / 2, 0.1333),
        (0, -PI / 2, 0.0997), (0, 0, 0.0996)]  # fmt: skip
PANDA = [(0, 0, 0.333), (0, -PI / 2, 0), (0, PI / 2, 0.316), (0.0825, PI / 2, 0),
         (-0.0825, -PI / 2, 0.384), (0, PI / 2, 0), (0.088, PI / 2, 0), (0, 0, 0.107)]  # fmt: skip
IIWA = [(0, -PI / 2, 0.36), (0, PI / 2, 0), (0, PI / 2, 0.42), (0, -PI / 2, 0), (0, -PI / 2, 0.4),
        (0, PI / 2, 0), (0, 0, 0.126)]  # fmt: skip


def turn(axis, angle):
    c, s = np.cos(angle), np.sin(angle)
    out = np.eye(4)
    if axis == "z":
        out[:2, :2] = [[c, -s], [s, c]]
    else:
        out[1:3, 1:3] = [[c, -s], [s, c]]
    return out


def along(axis, length):
    out = np.eye(4)
    out["xyz".index(axis), 3] = length
    return out


def tool(rows, q, modified, base):
    pose = base
    for (a, alpha, d), angle in zip(rows, [*q, 0.0, 0.0], strict=False):
        link = (along("x", a), turn("x", alpha))
        screw = (turn("z", angle), along("z", d))
        first, second = (link, screw) if modified else (screw, link)
        for part in (*first, *second):
            pose = pose @ part
    return pose


@pytest.mark.parametrize(
    ("name", "rows", "modified", "base"),
    [
        ("ur5e", UR5E, False, turn("z", PI)),
        ("panda", PANDA, True, np.eye(4)),
        ("iiwa14", IIWA, False, np.eye(4)),
    ],
)
def test_the_tool_is_where_the_makers_parameters_say(name, rows, modified, base):
    scene = compose(SceneSpec(arm=name))
    model, data = scene.model, mujoco.MjData(scene.model)
    rng = np.random.default_rng(5)
    site = model.site(scene.facts.tool).id
    for _ in range(20):
        q = rng.uniform(*model.jnt_range.T)
        data.qpos[scene.qpos_adr] = q
        mujoco.mj_kinematics(model, data)
        expected = tool(rows, q, modified, base)
        np.testing.assert_allclose(data.site_xpos[site], expected[:3, 3], atol=1e-9)


def test_they_need_no_other_package(monkeypatch):
    import sys

    for gone in ("mujoco_menagerie",):
        monkeypatch.setitem(sys.modules, gone, None)
    monkeypatch.setattr("tauguard.models.known_robots.robot_data_folders", list)
    for name, joints in (("ur5e", 6), ("panda", 7), ("iiwa14", 7)):
        arm = load_arm(name)
        assert len(arm.joints) == joints
        assert "shapes" not in arm.facts.sources
        assert "implausible" not in arm.facts.sources["torque_limit"]
