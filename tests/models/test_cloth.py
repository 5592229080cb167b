"""A cloth in the scene: it hangs, it is pushed by the arm, and the labels see it."""

import mujoco
import numpy as np
import pytest

from tauguard.models import Cloth, SceneSpec, compose
from tauguard.models.cloth import PINS


def after(scene, steps):
    data = mujoco.MjData(scene.model)
    mujoco.mj_forward(scene.model, data)
    start = data.flexvert_xpos.copy()
    mujoco.mj_step(scene.model, data, steps)
    return start, data


@pytest.mark.parametrize("pinned", PINS)
def test_held_vertices_stay_and_the_others_stay_near(pinned):
    cloth = Cloth(count=8, pinned=pinned)
    start, data = after(compose(SceneSpec(labels=False, cloth=cloth)), 500)
    moved = np.linalg.norm(data.flexvert_xpos - start, axis=1)
    held = cloth.pins()
    assert len(held) == {"none": 0, "edge": 8, "corners": 2, "frame": 28}[pinned]
    np.testing.assert_array_equal(moved[held], 0)
    top = start[:, 2].max()
    assert all(start[k, 2] == pytest.approx(top) for k in held) or pinned == "frame"
    if pinned == "none":
        np.testing.assert_allclose(moved, 9.81 * 0.5**2 / 2, rtol=0.01)
    else:
        assert moved.max() < 0.2


def test_mass_and_size_are_as_listed():
    cloth = Cloth(count=6, size=0.5, mass=0.3, pinned="none", position=(0.4, 0.1, 0.9))
    scene = compose(SceneSpec(labels=False, cloth=cloth))
    start, _ = after(scene, 1)
    bare = compose(SceneSpec(labels=False))
    assert scene.model.body_mass.sum() - bare.model.body_mass.sum() == pytest.approx(0.3)
    np.testing.assert_allclose(np.ptp(start, axis=0), [0, 0.5, 0.5], atol=1e-9)
    np.testing.assert_allclose(start.mean(axis=0), [0.4, 0.1, 0.9], atol=1e-9)


def test_labels_see_the_cloth_and_project_to_the_constraint_torque():
    """The arm turns into a hanging cloth; its constraint torque is J^T of the labels."""
    scene = compose(SceneSpec(cloth=Cloth(count=10, position=(0.3, 0.15, 0.8))))
    model, data = scene.model, mujoco.MjData(scene.model)
    data.qpos[scene.qpos_adr] = scene.home
    data.qvel[scene.dof_adr[0]] = 0.4
    jac = np.zeros((6, model.nv))
    arm = scene.dof_adr
    touched, largest = 0, 0.0
    for _ in range(150):
        mujoco.mj_step1(model, data)
        data.qfrc_applied[arm] = data.qfrc_bias[arm]
        mujoco.mj_step2(model, data)
        tau = np.zeros(model.nv)
        mujoco.mj_forward(model, data)
        readings = data.sensordata.reshape(6, 10)
        for body, row in zip(scene.link_bodies, readings, strict=True):
            mujoco.mj_jac(model, data, jac[:3], jac[3:], row[7:10], body)
            tau -= jac.T @ row[1:7]
        touched += bool((readings[:, 0] > 0).any())
        largest = max(largest, float(np.abs(tau[arm]).max()))
        np.testing.assert_allclose(tau[arm], data.qfrc_constraint[arm], atol=1e-9)
    assert touched > 20
    assert largest > 0.1


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"count": 1}, "Cloth.count 1: expected a whole number from 2 to 200"),
        ({"size": 0.0}, "Cloth.size 0.0: expected above 0"),
        ({"mass": float("nan")}, "Cloth.mass nan: expected above 0"),
        ({"pinned": "top"}, "expected one of none, edge, corners, frame"),
    ],
)
def test_bad_cloth_is_named(values, message):
    with pytest.raises(ValueError, match=message):
        Cloth(**values)
