"""The composer: what is listed is there, nothing else; obstacles push as stiffly as they say."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.models import (
    BodyProxy,
    Clamp,
    Friction,
    Mismatch,
    SceneSpec,
    Sensors,
    Striker,
    compose,
    cura6_drive,
    set_payload,
)


def names(scene) -> set[str]:
    return {scene.model.body(i).name for i in range(scene.model.nbody)}


def test_only_what_is_listed():
    bare = compose(SceneSpec(labels=False))
    assert not names(bare) & {"payload", "striker", "clamp"}
    assert (bare.model.nsensor, bare.model.nv, bare.payload_body) == (0, 6, -1)
    full = compose(SceneSpec(payload=True, striker=Striker(), clamp=Clamp(), floor=True))
    assert names(full) >= {"payload", "striker", "clamp"}
    assert full.obstacle_names == ("striker", "clamp")
    assert full.model.nsensor == 6


def test_same_spec_same_text_and_the_text_compiles_to_the_same_model():
    spec = SceneSpec(mismatch=Mismatch(4), payload=True, striker=Striker(), clamp=Clamp())
    one, two = compose(spec), compose(spec)
    assert one.xml == two.xml
    again = mujoco.MjModel.from_xml_string(one.xml)
    np.testing.assert_allclose(again.body_inertia, one.model.body_inertia, rtol=1e-4, atol=1e-9)
    assert again.nsensordata == one.model.nsensordata


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_every_perturbed_arm_is_possible_and_within_its_widths(seed):
    nominal, scene = compose(SceneSpec()), compose(SceneSpec(mismatch=Mismatch(seed)))
    for body in scene.link_bodies:
        a, b, c = np.sort(scene.model.body_inertia[body])
        assert 0 < a <= b <= c <= a + b
    ratio = scene.model.body_mass[scene.link_bodies] / nominal.model.body_mass[scene.link_bodies]
    assert (np.abs(ratio - 1) <= 0.05 + 1e-9).all()
    assert (np.abs(scene.drive.gain / nominal.drive.gain - 1) <= 0.05 + 1e-9).all()


def test_mismatch_leaves_the_nominal_arm_alone():
    assert compose(SceneSpec(mismatch=Mismatch(1))).arm_xml == compose(SceneSpec()).arm_xml


@pytest.mark.parametrize("stiffness", [5e3, 5e4])
def test_a_clamp_pushes_with_its_stiffness(stiffness):
    """Pressed a known depth into the upper arm, at rest: force = stiffness x depth."""
    scene = compose(SceneSpec(clamp=Clamp(stiffness=stiffness, damping=0.0)))
    model, data = scene.model, mujoco.MjData(scene.model)
    body = model.body("link2").id
    mujoco.mj_forward(model, data)
    geom = int(model.body_geomadr[body])
    geom += next(i for i in range(20) if model.geom_group[geom + i] == 3)
    depth, reach = 0.002, float(model.geom_size[geom, 0]) + 0.05
    data.mocap_pos[0] = data.geom_xpos[geom] + [reach - depth, 0, 0]
    mujoco.mj_forward(model, data)
    force = -data.sensordata.reshape(6, 10)[1, 1:4]
    assert force[0] == pytest.approx(-stiffness * depth, rel=0.02)


def test_payload_changes_gravity_torque_and_nothing_else():
    scene = compose(SceneSpec(payload=True))
    model, data = scene.model, mujoco.MjData(scene.model)
    mujoco.mj_resetDataKeyframe(model, data, 0) if model.nkey else None
    data.qvel[:] = 0.1
    mujoco.mj_forward(model, data)
    before, state = data.qfrc_bias.copy(), data.qpos.copy()
    set_payload(model, data, scene.payload_body, 4.039)
    mujoco.mj_forward(model, data)
    np.testing.assert_array_equal(data.qpos, state)
    jac = np.zeros((3, model.nv))
    mujoco.mj_jacBodyCom(model, data, jac, None, scene.payload_body)
    data.qvel[:] = 0
    mujoco.mj_forward(model, data)
    still = data.qfrc_bias.copy()
    set_payload(model, data, scene.payload_body, 0.0)
    mujoco.mj_forward(model, data)
    added = still - data.qfrc_bias
    np.testing.assert_allclose(added, jac.T @ [0, 0, 9.81 * 4.039], atol=1e-4)
    assert np.abs(before).max() > 0


def test_bad_input_is_named():
    scene = compose(SceneSpec())
    with pytest.raises(ValueError, match="payload=True"):
        set_payload(scene.model, mujoco.MjData(scene.model), -1, 1.0)
    with pytest.raises(ValueError, match=r"at most 0\.02"):
        SceneSpec(timestep=0.5)
    with pytest.raises(ValueError, match=r"Mismatch.gain 2: expected 0 to 0.9"):
        Mismatch(seed=0, gain=2)
    six = np.ones(6)
    with pytest.raises(ValueError, match=r"Friction.viscous: shape \(2,\)"):
        Friction(six, six, six, np.ones(2), six, six)


def test_sensors_quantise_after_noise():
    rng = np.random.default_rng(0)
    sensors = Sensors(np.full(6, 0.02), np.full(6, 0.01), position_quantum=1e-3)
    q, qd, current = sensors.measure(rng, *rng.uniform(size=(3, 5000, 6)))
    np.testing.assert_allclose(current / 0.01, np.round(current / 0.01), atol=1e-9)
    np.testing.assert_allclose(q / 1e-3, np.round(q / 1e-3), atol=1e-9)
    assert np.isfinite(qd).all()
    assert cura6_drive().sensors is not None


@pytest.mark.parametrize(
    "spec",
    [
        SceneSpec(proxies=(BodyProxy("chest", (0.25, 0.3, 0.45), (0, -1, 0)),)),
        SceneSpec(striker=Striker(), clamp=Clamp(), payload=True, mismatch=Mismatch(4)),
    ],
)
def test_shapes_that_only_show_do_not_move_anything(spec):
    scenes = compose(spec), compose(spec, visuals=False)
    assert scenes[1].model.ngeom < scenes[0].model.ngeom
    assert scenes[1].xml == scenes[0].xml
    ends = []
    for scene in scenes:
        data = mujoco.MjData(scene.model)
        data.qpos[scene.qpos_adr] = scene.home
        for name in {"chest", "striker"} & names(scene):  # thrown at the falling arm
            data.qvel[scene.model.jnt_dofadr[scene.model.body(name).jntadr[0]] :][:1] = 1.0
        touched = 0
        for _ in range(1500):
            mujoco.mj_step(scene.model, data)
            touched += data.ncon
        ends.append(np.concatenate([data.qpos, data.qvel, data.sensordata, [touched]]))
    assert np.array_equal(*ends)
