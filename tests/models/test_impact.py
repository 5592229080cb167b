"""Reflected mass against Pinocchio and against the rail, where it is known."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.models import SceneSpec, compose, pin_model
from tauguard.models.impact import impact_velocity, reflected_mass, standard_mass

from .arms import SLED

SCENE = compose(SceneSpec())
ARM = pin_model(SCENE.arm_xml)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.integers(2, 6))
def test_as_pinocchio_has_it(seed, link):
    rng = np.random.default_rng(seed)
    q, offset, n = rng.uniform(-2, 2, 6), rng.uniform(-0.1, 0.1, 3), rng.normal(size=3)
    n /= np.linalg.norm(n)
    data = ARM.createData()
    mass = pin.crba(ARM, data, q)
    mass = np.triu(mass) + np.triu(mass, 1).T
    pin.computeJointJacobians(ARM, data, q)
    jac = pin.getJointJacobian(ARM, data, link, pin.LOCAL_WORLD_ALIGNED)
    moved = jac[:3] + np.cross(jac[3:].T, offset).T
    point = data.oMi[link].translation + offset
    expected = 1 / (n @ moved @ np.linalg.solve(mass, moved.T @ n))
    body = int(SCENE.link_bodies[link - 1])
    assert reflected_mass(SCENE, q, body, point, n) == pytest.approx(expected, rel=1e-9)
    qd = impact_velocity(SCENE, q, body, point, 3 * n, 0.4)
    assert n @ moved @ qd == pytest.approx(0.4)
    energy = qd @ mass @ qd / 2
    assert energy == pytest.approx(expected * 0.4**2 / 2, rel=1e-9)


def test_a_mass_on_a_rail_is_as_heavy_as_it_is(tmp_path):
    path = tmp_path / "sled.xml"
    path.write_text(SLED.format(mass=7.0))
    scene = compose(SceneSpec(arm=str(path)))
    body = int(scene.link_bodies[0])
    assert reflected_mass(scene, [0.3], body, [0.3, 0, 0], [2, 0, 0]) == pytest.approx(7.0)
    assert standard_mass(scene, 2.0) == pytest.approx(5.5)
    with pytest.raises(ValueError, match="no joint moves"):
        reflected_mass(scene, [0.0], body, [0, 0, 0], [0, 1, 0])
    with pytest.raises(ValueError, match="not all zero"):
        reflected_mass(scene, [0.0], body, [0, 0, 0], [0, 0, 0])
