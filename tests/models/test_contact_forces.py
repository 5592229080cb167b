"""Contact labels and stiffness against mechanics on paper."""

import mujoco
import numpy as np
import pytest

from tauguard.models import (
    BODY_REGIONS,
    BodyProxy,
    Clamp,
    SceneSpec,
    Striker,
    Table,
    compose,
    set_payload,
)

from .arms import SLED

DT = 1e-3


def sled(tmp_path, mass):
    path = tmp_path / "sled.xml"
    path.write_text(SLED.format(mass=mass))
    return str(path)


@pytest.mark.parametrize("region", BODY_REGIONS)
def test_a_blow_follows_the_two_mass_model(tmp_path, region):
    """Peak force = v sqrt(mu k), within 2 % at 1 ms, for every body region."""
    speed, mass = 0.25, 12.0
    proxy = BodyProxy(region, (0.125, 0, 0), radius=0.07)
    scene = compose(SceneSpec(arm=sled(tmp_path, mass), gravity=(0, 0, 0), proxies=(proxy,)))
    model, data = scene.model, mujoco.MjData(scene.model)
    data.qvel[0] = speed
    peak = 0.0
    for _ in range(400):
        mujoco.mj_step(model, data)
        peak = max(peak, data.sensordata[1])
    expected = proxy.limits.peak_force(speed, mass)
    assert peak == pytest.approx(expected, rel=0.02)
    momentum = mass * data.qvel[0] + proxy.limits.mass * data.qvel[1]
    assert momentum == pytest.approx(mass * speed, rel=1e-9)


def test_pressed_against_a_held_region_the_label_is_the_force(tmp_path):
    """A constant push ends in that force on the arm, away from the obstacle."""
    proxy = BodyProxy("chest", (0.119, 0, 0), clamped=True, damping=800.0)
    scene = compose(SceneSpec(arm=sled(tmp_path, 5.0), gravity=(0, 0, 0), proxies=(proxy,)))
    model, data = scene.model, mujoco.MjData(scene.model)
    data.qfrc_applied[0] = 60.0
    for _ in range(3000):
        mujoco.mj_step(model, data)
    found, force, _, point = np.split(data.sensordata, [1, 4, 7])
    assert found == 1
    np.testing.assert_allclose(-force, [-60, 0, 0], atol=1e-3)
    depth = 60 / proxy.stiffness
    assert data.qpos[0] == pytest.approx(-0.001 + depth, rel=0.02)
    assert point[0] == pytest.approx((data.qpos[0] + 0.05 + 0.119 - 0.07) / 2, abs=1e-9)


def test_labels_project_to_mujocos_constraint_torque():
    """With one obstacle pressed into two links at once, the sum of J^T w is qfrc_constraint."""
    scene = compose(SceneSpec(clamp=Clamp(radius=0.2)))
    model, data = scene.model, mujoco.MjData(scene.model)
    data.qpos[scene.qpos_adr] = scene.home
    mujoco.mj_forward(model, data)
    wrist = (data.body("link4").xpos + data.body("link5").xpos) / 2
    data.mocap_pos[0] = wrist + np.array([0.0, 0.0, 0.2])
    data.qvel[:6] = [0.3, -0.2, 0.4, 0.1, -0.3, 0.2]
    mujoco.mj_forward(model, data)
    tau = np.zeros(model.nv)
    jac = np.zeros((6, model.nv))
    readings = data.sensordata.reshape(6, 10)
    assert (readings[:, 0] > 0).sum() >= 2
    for body, row in zip(scene.link_bodies, readings, strict=True):
        mujoco.mj_jac(model, data, jac[:3], jac[3:], row[7:10], body)
        tau -= jac.T @ row[1:7]
    assert np.abs(data.qfrc_constraint).max() > 1
    np.testing.assert_allclose(tau, data.qfrc_constraint, atol=1e-9)


def test_a_ball_thrown_at_a_link_gives_it_its_momentum():
    """The impulse of the label equals what the weightless ball lost."""
    scene = compose(SceneSpec(striker=Striker(mass=1.0)))
    model, data = scene.model, mujoco.MjData(scene.model)
    data.qpos[scene.qpos_adr] = scene.home
    mujoco.mj_forward(model, data)
    start = data.body("link3").xpos + np.array([0, 0, 0.3])
    ball = model.joint(int(model.body("striker").jntadr[0]))
    at, dof = int(ball.qposadr[0]), int(ball.dofadr[0])
    data.qpos[at : at + 3] = start
    data.qvel[dof : dof + 3] = [0, 0, -1.0]
    impulse = np.zeros(3)
    for _ in range(400):
        mujoco.mj_step(model, data)
        impulse -= data.sensordata.reshape(6, 10)[:, 1:4].sum(axis=0) * DT
    lost = np.array([0, 0, -1.0]) - data.qvel[dof : dof + 3]
    assert np.linalg.norm(lost) > 0.5
    np.testing.assert_allclose(impulse, lost, atol=1e-6)


def test_a_payload_leaves_the_stiffness_as_it_says():
    """The payload changes the arm's inverse weight, on which MuJoCo's stiffness depends."""
    scene = compose(SceneSpec(payload=True, clamp=Clamp(stiffness=3e4, damping=0.0)))
    model, data = scene.model, mujoco.MjData(scene.model)
    set_payload(model, data, scene.payload_body, 4.039)
    mujoco.mj_forward(model, data)
    link = scene.link_bodies[5]
    geom = next(
        g for g in range(model.ngeom) if model.geom_bodyid[g] == link and model.geom_contype[g]
    )
    depth, reach = 0.002, model.geom_size[geom, 0] + 0.05
    data.mocap_pos[0] = data.geom_xpos[geom] + [reach - depth, 0, 0]
    mujoco.mj_forward(model, data)
    force = -data.sensordata.reshape(6, 10)[5, 1:4]
    assert force[0] == pytest.approx(-3e4 * depth, rel=0.02)


def test_the_arm_leans_on_the_table():
    """Pressed onto a table, at rest: drive torque - gravity torque = -J^T (force of the table)."""
    scene = compose(SceneSpec(table=Table((0.4, 0.1, 0.67), (0.3, 0.3, 0.02))))
    model, data = scene.model, mujoco.MjData(scene.model)
    data.qpos[scene.qpos_adr] = scene.home
    target = scene.home + np.array([0, 0.15, 0, 0, 0, 0])
    for _ in range(3000):
        mujoco.mj_step1(model, data)
        spring = 2000 * (target - data.qpos[scene.qpos_adr]) - 200 * data.qvel[scene.dof_adr]
        data.qfrc_applied[scene.dof_adr] = data.qfrc_bias[scene.dof_adr] + spring
        mujoco.mj_step2(model, data)
    tau, jac = np.zeros(model.nv), np.zeros((6, model.nv))
    for body, row in zip(scene.link_bodies, data.sensordata.reshape(6, 10), strict=True):
        mujoco.mj_jac(model, data, jac[:3], jac[3:], row[7:10], body)
        tau -= jac.T @ row[1:7]
    assert data.sensordata.reshape(6, 10)[:, 3].sum() < -20
    np.testing.assert_allclose(spring, -tau, atol=0.1)
