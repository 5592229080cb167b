"""The files of the arm and its other sizes: conventions, strength, inertias of their shapes."""

import mujoco
import numpy as np
import pytest

from tauguard.models import cura6, cura6_drive


@pytest.fixture(scope="module")
def model():
    return mujoco.MjModel.from_xml_string(cura6.arm_xml())


@pytest.mark.parametrize("name", cura6.NAMES)
def test_inertias_are_of_the_visual_cylinders(name):
    """Their volumes share the link's mass; housings weigh three times as much as tubes."""
    spec = mujoco.MjSpec.from_string(cura6.arm_xml(name))
    for body in spec.bodies[2:]:
        solid = mujoco.MjSpec()
        link = solid.worldbody.add_body()
        for geom in body.geoms:
            if geom.classname.name == "visual" and geom.type == mujoco.mjtGeom.mjGEOM_CYLINDER:
                length = np.linalg.norm(geom.fromto[3:] - geom.fromto[:3])
                dense = 1.0 if length > 4 * geom.size[0] else 3.0
                link.add_geom(
                    type=geom.type, fromto=geom.fromto, size=geom.size, density=1000 * dense
                )
        model = solid.compile()
        scale = body.mass / model.body_mass[1]
        np.testing.assert_allclose(model.body_ipos[1], body.ipos, rtol=1e-5, atol=1e-7)
        axes = np.empty(9)
        mujoco.mju_quat2Mat(axes, model.body_iquat[1])
        axes = axes.reshape(3, 3)
        inertia = scale * axes @ np.diag(model.body_inertia[1]) @ axes.T
        full = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        np.testing.assert_allclose(full, body.fullinertia, rtol=1e-5, atol=1e-7)


def test_menagerie_conventions(model):
    assert [model.joint(i).name for i in range(model.njnt)] == list(cura6.JOINTS)
    np.testing.assert_allclose(model.key("home").qpos, cura6.HOME, atol=1e-6)
    visual, collision = model.geom_group == 2, model.geom_group == 3
    assert (visual | collision).all()
    assert (model.geom_contype[visual] == 0).all()
    assert (model.geom_contype[collision] == 1).all()
    assert model.site("flange").bodyid[0] == model.body("link6").id


def test_every_inertia_is_possible(model):
    for body in range(2, model.nbody):
        a, b, c = np.sort(model.body_inertia[body])
        assert 0 < a <= b <= c <= a + b


def test_the_tool_points_down_at_home(model):
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.site("flange").xmat.reshape(3, 3)[:, 2], [0, 0, -1], atol=1e-3)


def test_carries_4039_g_at_full_stretch(model):
    """Gravity with the payload on the stretched arm needs less than the drives can give."""
    data = mujoco.MjData(model)
    data.qpos[:] = [0, np.pi / 2, 0, 0, 0, 0]
    mujoco.mj_forward(model, data)
    jac = np.zeros((3, model.nv))
    mujoco.mj_jacSite(model, data, jac, None, model.site("flange").id)
    needed = np.abs(data.qfrc_bias + jac.T @ [0, 0, 9.81 * 4.039])
    limit = cura6_drive().torque_limit
    assert (needed < 0.75 * limit).all()
    np.testing.assert_allclose(limit, model.jnt_actfrcrange[:, 1], rtol=0.15)


def test_simulates_a_second_without_control(model):
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(1000):
        mujoco.mj_step(model, data)
    assert np.isfinite(data.qpos).all()
    assert data.ncon == 0
