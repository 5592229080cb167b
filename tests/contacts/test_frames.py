"""Geoms on bodies without joints move with the body that carries them."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.contacts import GuardedStepper
from tauguard.contacts.frames import frame_on_mover, movers
from tauguard.contacts.pairs import geom_pairs


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_a_geom_is_where_mujoco_puts_it(seed):
    rng = np.random.default_rng(seed)
    spec, bodies = mujoco.MjSpec(), []
    for k in range(12):
        parent = spec.worldbody if k == 0 or rng.random() < 0.2 else bodies[rng.integers(k)]
        mocap = parent is spec.worldbody and rng.random() < 0.3
        body = parent.add_body(pos=rng.normal(size=3), quat=rng.normal(size=4), mocap=mocap)
        if rng.random() < 0.4 and not mocap:
            body.add_joint(axis=[0, 0, 1])
        geom = body.add_geom(size=[0.1, 0.1, 0.1], type=mujoco.mjtGeom.mjGEOM_BOX)
        geom.pos, geom.quat = rng.normal(size=3) * (rng.random() < 0.7), rng.normal(size=4)
        bodies.append(body)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:] = rng.normal(size=model.nq)
    mujoco.mj_kinematics(model, data)
    for geom in range(model.ngeom):
        mover, pos, mat = frame_on_mover(model, geom)
        assert model.body_weldid[mover] == model.body_weldid[model.geom_bodyid[geom]]
        turn = data.xmat[mover].reshape(3, 3)
        np.testing.assert_allclose(data.xpos[mover] + turn @ pos, data.geom_xpos[geom], atol=1e-13)
        np.testing.assert_allclose(turn @ mat.reshape(3, 3), data.geom_xmat[geom].reshape(3, 3),
                                   atol=1e-13)  # fmt: skip
    carried = model.body_jntnum[movers(model)] == 0
    assert (model.body_parentid[movers(model)[carried]] == 0).all()


@pytest.mark.parametrize("depth", [0, 1, 2])
@pytest.mark.parametrize(
    ("timestep", "speed"), [(0.002, 25.0), (0.005, 25.0), (0.01, 10.0), (0.01, 30.0)]
)
def test_a_thin_tool_does_not_pass_a_thin_post_within_the_arc_of_a_step(depth, timestep, speed):
    at = 2.5 * speed * timestep
    tool = '<geom type="capsule" size=".0005 .05" mass="1e-6"/>'
    for _ in range(depth):
        tool = f'<body pos="{1 / depth} 0 0">{tool}</body>'
    if not depth:
        tool = tool.replace("/>", ' pos="1 0 0"/>')
    model = mujoco.MjModel.from_xml_string(f"""<mujoco><option timestep="{timestep}"
      gravity="0 0 0"/><worldbody>
      <geom type="capsule" size=".0005 .05" pos="{np.cos(at)} {np.sin(at)} 0"/>
      <body><joint axis="0 0 1"/><geom size=".05" mass="100" contype="0" conaffinity="0"/>{tool}
      </body></worldbody></mujoco>""")
    data = mujoco.MjData(model)
    data.qvel[0] = speed
    guard = GuardedStepper(model, data)
    for _ in range(4):
        assert not guard.step().exhausted
    assert data.qpos[0] < 1.02 * at


def test_an_edited_pose_of_a_tool_link_is_followed():
    model = mujoco.MjModel.from_xml_string("""<mujoco><option timestep=".01" gravity="0 0 0"/>
      <worldbody><geom type="capsule" size=".001 .05" pos="0 .5 0"/>
      <body><joint axis="0 0 1"/><geom size=".05" mass="9" contype="0" conaffinity="0"/>
      <body name="tool" pos="1 0 0"><geom type="capsule" size=".001 .05" mass="1e-6"/></body></body>
      </worldbody></mujoco>""")
    data = mujoco.MjData(model)
    data.qvel[0] = 20
    guard = GuardedStepper(model, data)
    guard.step()
    model.body_pos[model.body("tool").id] = [0.5, 0, 0]
    for _ in range(12):
        assert not guard.step().exhausted
    assert data.qpos[0] < 1.01 * np.pi / 2


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_exclusions_in_any_order_are_those_of_mujoco(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 8))
    bodies = "".join(
        f'<body name="b{k}" pos="{x} {y} {z}"><freejoint/><geom size=".1"/></body>'
        for k, (x, y, z) in enumerate(rng.uniform(-0.05, 0.05, (n, 3)))
    )
    couples = rng.permutation([(i, j) for i in range(n) for j in range(i)])
    excludes = "".join(
        f'<exclude body1="b{i}" body2="b{j}"/>' for i, j in couples[: rng.integers(1, len(couples))]
    )
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody>{bodies}</worldbody><contact>{excludes}</contact></mujoco>"
    )
    listed = model.exclude_signature
    edits = (
        lambda: rng.permutation(listed),
        lambda: rng.integers(0, (n + 2) << 16, len(listed)),
        lambda: np.where(rng.random(len(listed)) < 0.5, listed, (rng.integers(n) << 16) + n),
    )
    listed[:] = edits[rng.integers(3)]()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    expected = {tuple(sorted(map(int, contact.geom))) for contact in data.contact}
    pairs = geom_pairs(model)
    found = {tuple(sorted(map(int, pair))) for pair in zip(pairs.first, pairs.second, strict=True)}
    assert found == expected


@pytest.mark.parametrize("scale", [0.5, 3.0])
def test_a_quaternion_of_a_body_without_unit_length_is_normalized_as_by_mujoco(scale):
    model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody><body><joint axis="0 0 1"/>
      <geom size=".1"/><body pos="1 0 0" euler="10 20 30"><geom type="box" size=".1 .2 .3"
      pos=".5 0 0"/></body></body><geom type="plane" size="9 9 1"/></worldbody></mujoco>""")
    model.body_quat[2] *= scale
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    _, pos, mat = frame_on_mover(model, 2)
    np.testing.assert_allclose(pos, data.geom_xpos[2] - data.xpos[1], atol=1e-13)
    np.testing.assert_allclose(mat, data.geom_xmat[2], atol=1e-13)
    assert GuardedStepper(model, data).step().steps == 1
