"""The arm's file: conventions, strength, and that it is what its table says."""

import mujoco
import numpy as np
import pytest

from tauguard.models import cura6, cura6_drive
from tauguard.models.cura6 import design


@pytest.fixture(scope="module")
def model():
    return mujoco.MjModel.from_xml_string(cura6.arm_xml())


def test_the_file_is_what_the_table_writes():
    assert cura6.arm_xml() == design.mjcf()


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
    np.testing.assert_allclose(limit, [link.torque for link in design.LINKS], rtol=0.15)


def test_simulates_a_second_without_control(model):
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(1000):
        mujoco.mj_step(model, data)
    assert np.isfinite(data.qpos).all()
    assert data.ncon == 0
