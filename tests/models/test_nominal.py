"""The Pinocchio model against MuJoCo, also on arms that the usual parser gets wrong."""

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from tauguard.models import cura6, pin_model


def differences(m: mujoco.MjModel, model: pin.Model, states: int) -> dict[str, float]:
    """Largest absolute differences over random states; bodies and joints in the same order."""
    rng = np.random.default_rng(7)
    d, data = mujoco.MjData(m), model.createData()
    worst = dict.fromkeys(("mass", "bias", "gravity", "jacobian"), 0.0)
    for _ in range(states):
        q, v = rng.uniform(-3, 3, m.nq), rng.uniform(-2, 2, m.nv)
        d.qpos[:], d.qvel[:] = q, v
        mujoco.mj_forward(m, d)
        mass, jac = np.zeros((m.nv, m.nv)), np.zeros((6, m.nv))
        mujoco.mj_fullM(m, d, mass)
        pin.crba(model, data, q)
        theirs = np.triu(data.M) + np.triu(data.M, 1).T
        bias = pin.rnea(model, data, q, v, np.zeros(m.nv))
        worst["mass"] = max(worst["mass"], np.abs(mass - theirs).max())
        worst["bias"] = max(worst["bias"], np.abs(d.qfrc_bias - bias).max())
        d.qvel[:] = 0
        mujoco.mj_forward(m, d)
        still = pin.computeGeneralizedGravity(model, data, q)
        worst["gravity"] = max(worst["gravity"], np.abs(d.qfrc_bias - still).max())
        last = m.jnt_bodyid[m.njnt - 1]
        point = d.xanchor[m.njnt - 1]
        mujoco.mj_jac(m, d, jac[:3], jac[3:], point, last)
        joint = model.njoints - 1
        pin.computeJointJacobians(model, data, q)
        frame = pin.getJointJacobian(model, data, joint, pin.LOCAL_WORLD_ALIGNED)
        worst["jacobian"] = max(worst["jacobian"], np.abs(jac - frame).max())
    return worst


def arm(base: str = "", gravity: str = "0 0 -9.81") -> mujoco.MjModel:
    text = cura6.arm_xml()
    text = text.replace('<body name="base">', f'<body name="base" {base}>')
    text = text.replace("<option ", f'<option gravity="{gravity}" ')
    return mujoco.MjModel.from_xml_string(text)


@pytest.mark.parametrize(
    ("base", "gravity"),
    [
        ("", "0 0 -9.81"),
        ('pos="0.3 -0.2 0.9" euler="0.4 -1.1 2.0"', "0 0 -9.81"),
        ('euler="3.14159 0 0.3"', "1.2 -3.0 -9.0"),
    ],
    ids=["plain", "rotated base", "tilted gravity"],
)
def test_agrees_with_mujoco_at_a_thousand_states(base, gravity, record_property):
    m = arm(base, gravity)
    worst = differences(m, pin_model(m), 1000)
    for name, value in worst.items():
        record_property(name, float(value))
        assert value < 1e-10, f"{name}: {value}"


def test_slide_joints_anchors_and_fixed_bodies():
    m = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody>
        <body pos="0.1 0 0.2" euler="0.3 0 0"><joint type="slide" axis="1 1 0"/>
          <geom size="0.1" mass="2"/>
          <body pos="0 0.1 0.3"><joint axis="0 1 1" pos="0.05 0.02 -0.1" armature="0.3"/>
            <geom size="0.1 0.2 0.1" type="box" mass="1.5" pos="0.1 0 0.1"/>
            <body pos="0.2 0 0" euler="0 0.7 0"><geom size="0.05" mass="0.7" pos="0 0.1 0"/></body>
          </body></body></worldbody></mujoco>"""
    )
    assert max(differences(m, pin_model(m), 200).values()) < 1e-10


@pytest.mark.data
def test_urdf_of_a_real_arm(data_dir):
    path = data_dir / "ur10e" / "ur10e.urdf"
    ours, theirs = pin_model(path), pin.buildModelFromUrdf(str(path))
    assert ours.nq == 6
    rng = np.random.default_rng(3)
    a, b = ours.createData(), theirs.createData()
    for _ in range(200):
        q, v, acc = rng.uniform(-3, 3, (3, 6))
        np.testing.assert_allclose(
            pin.rnea(ours, a, q, v, acc), pin.rnea(theirs, b, q, v, acc), atol=1e-6
        )


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("<mujoco><worldbody/></mujoco>", "no joints"),
        (
            "<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>",
            "hinge",
        ),
        ("<mujoco><worldbody><body>", "robot: "),
        ("<robot name='x'><link>", "robot: "),
    ],
)
def test_bad_robots_are_named(source, message):
    with pytest.raises(ValueError, match=message):
        pin_model(source)


def test_missing_file_is_named():
    with pytest.raises(FileNotFoundError, match="no such robot file"):
        pin_model("nowhere/arm.xml")


def test_a_last_link_without_a_mass_is_one_of_next_to_none(tmp_path):
    """As many drivers' files have them; MuJoCo refuses a body that moves without a mass."""
    inertial = (
        '<inertial><mass value="2"/>'
        '<inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    joint = (
        '<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/>'
        '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
    )
    urdf = f'<robot name="two"><link name="base"/><link name="a">{inertial}</link>'
    urdf += '<link name="tip"/>' + joint.format("j1", "base", "a") + joint.format("j2", "a", "tip")
    urdf += "</robot>"
    path = tmp_path / "two.urdf"
    path.write_text(urdf)
    masses = [body.mass for body in pin_model(path).inertias]
    assert masses[1] == 2.0
    assert 0 < masses[2] < 1e-3
