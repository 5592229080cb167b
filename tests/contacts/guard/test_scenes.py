"""Scenes in which bodies once tunnelled, each by name; judged without the guard's own code."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from oracles.energy import energies
from oracles.tunnelling import Tunnelling
from tauguard.contacts import GuardedStepper
from tauguard.models.cloth import Cloth, add_cloth

STIFF = 'solref="1e-4 1" solimp=".99 .999 .001 .5 2" priority="1"'


def run(model, data, seconds, keeps):
    """Guarded steps; ``keeps(data)`` must stay true, and energy within 2 %."""
    guard = GuardedStepper(model, data)
    start, kinetic = energies(model, data)
    for _ in range(round(seconds / model.opt.timestep)):
        assert not guard.step().exhausted
        mujoco.mj_kinematics(model, data)
        assert keeps(data)
        assert sum(energies(model, data)) - start <= 1.02 * kinetic


def model_of(body, world="", options="", timestep=5e-3):
    return mujoco.MjModel.from_xml_string(f"""<mujoco>
      <option timestep="{timestep}" integrator="implicitfast" {options}/>
      <worldbody>{world}{body}</worldbody></mujoco>""")


PLATE = f'<geom name="plate" type="box" size=".2 .2 .0015" {STIFF}/>'


@pytest.mark.parametrize("k", range(0, 40, 4))
def test_the_other_end_of_a_tilted_capsule_does_not_tip_through_a_thin_plate(k):
    height = 0.0095 + 0.03 * np.cos(np.deg2rad(85)) + k / 40 * 0.1
    model = model_of(
        f"""<body pos="0 0 {height}" euler="0 85 0"><freejoint/>
        <geom name="rod" type="capsule" size=".003 .03" mass=".01"/></body>""",
        PLATE,
    )
    data = mujoco.MjData(model)
    data.qvel[2] = -20

    def keeps(data):
        axis = data.geom("rod").xmat.reshape(3, 3)[:, 2]
        ends = data.geom("rod").xpos + 0.03 * np.outer([-1, 0, 1], axis)
        inside = np.abs(ends[:, :2]).max(axis=1) < 0.19
        return (ends[inside, 2] > 0).all()

    run(model, data, 0.04, keeps)


@pytest.mark.parametrize("timestep", [1e-3, 2e-3, 5e-3])
@pytest.mark.parametrize("share", [0.0, 0.4, 0.8])
def test_spheres_that_meet_head_on_at_60_m_s(share, timestep):
    gap = 0.03 + share * 60 * timestep
    model = model_of(
        f"""<body><freejoint/><geom size=".01" mass=".02"/></body>
        <body pos="{gap} 0 0"><freejoint/><geom size=".01" mass=".03"/></body>""",
        options='gravity="0 0 0"',
        timestep=timestep,
    )
    data = mujoco.MjData(model)
    data.qvel[0], data.qvel[6] = 30, -30
    run(model, data, 0.02, lambda d: d.geom_xpos[1, 0] > d.geom_xpos[0, 0])


@pytest.mark.parametrize(("speed", "timestep"), [(5, 5e-3), (20, 5e-3), (20, 1e-3)])
def test_a_chain_of_capsules_on_a_thin_mesh_keeps_its_energy(speed, timestep):
    corners = " ".join(
        f"{x} {y} {z}" for x in (-0.4, 0.4) for y in (-0.4, 0.4) for z in (-1e-3, 1e-3)
    )
    links = ""
    for k in reversed(range(6)):
        joint = '<joint type="ball" pos="-.025 0 0"/>' if k else "<freejoint/>"
        links = f"""<body pos="{0.05 if k else -0.12} 0 {0 if k else 0.03}">{joint}<geom
          name="link{k}" type="capsule" fromto="-.02 0 0 .02 0 0" size=".005" mass=".02"/>
          {links}</body>"""
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>
      <option timestep="{timestep}" integrator="implicitfast"/>
      <asset><mesh name="sheet" vertex="{corners}"/></asset>
      <worldbody><geom type="mesh" mesh="sheet" {STIFF}/>{links}</worldbody></mujoco>""")
    data = mujoco.MjData(model)
    data.qvel[2] = -speed
    chain = [model.geom(f"link{k}").id for k in range(6)]
    run(model, data, 0.05, lambda d: (d.geom_xpos[chain, 2] > 0).all())


@pytest.mark.parametrize(("seed", "timestep"), [(0, 5e-3), (1, 2e-3), (2, 5e-3)])
def test_balls_stay_in_a_cup_that_is_jerked(seed, timestep):
    rng = np.random.default_rng(seed)
    walls = "".join(
        f'<geom type="box" pos="{x} {y} {z}" size="{a} {b} {c}"/>'
        for x, y, z, a, b, c in (
            (0, 0, -0.001, 0.05, 0.05, 0.001),
            (0.051, 0, 0.05, 0.001, 0.05, 0.05),
            (-0.051, 0, 0.05, 0.001, 0.05, 0.05),
            (0, 0.051, 0.05, 0.05, 0.001, 0.05),
            (0, -0.051, 0.05, 0.05, 0.001, 0.05),
        )
    )
    balls = ""
    for k in range(24):
        x, y = 0.022 * (k % 4) - 0.033, 0.022 * (k // 4 % 3) - 0.022
        x, y = np.array([x, y]) + rng.uniform(-1e-3, 1e-3, 2)
        balls += f"""<body pos="{x} {y} {0.009 + 0.02 * (k // 12)}"><freejoint/>
          <geom name="ball{k}" size=".008" mass=".005"/></body>"""
    cup = f'<body name="cup"><joint name="rail" type="slide" axis="1 0 0"/>{walls}</body>'
    model = model_of(cup + balls, timestep=timestep)
    data = mujoco.MjData(model)
    data.qvel[model.joint("rail").dofadr[0]] = 15
    ids = [model.geom(f"ball{k}").id for k in range(24)]

    def keeps(data):
        at = data.geom_xpos[ids] - data.body("cup").xpos
        below = at[:, 2] < 0.1  # over the brim a ball may leave
        return (np.abs(at[below, :2]) < 0.051).all() and (at[below, 2] > -0.001).all()

    run(model, data, 0.04, keeps)


def into_cloth(kind, size, how, speed, timestep, pinned="frame"):
    """A body of 20 g on its way into cloth, or into a flag that hangs."""
    hangs, turn = pinned == "edge", np.sqrt(0.5)
    cloth = Cloth(
        count=13,
        size=0.3,
        mass=0.05,
        position=(0, 0, 0),
        quat_wxyz=(turn, turn, 0, 0) if hangs else (1, 0, 0, 0),
        pinned=pinned,
        young=1e7,
        solref=(1e-4, 1.0),
    )
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.gravity = timestep, [0, 0, 0]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    add_cloth(spec, cloth)
    body = spec.worldbody.add_body(name="body")
    body.add_freejoint()
    body.add_geom(name="body", type=kind, size=size, mass=0.02, conaffinity=2)
    model = spec.compile()
    model.flex_priority[0] = 1
    model.flex_solimp[0] = (0.99, 0.999, 0.001, 0.5, 2)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    normal = np.array([0, 1.0, 0]) if hangs else np.array([0, 0, 1.0])
    data.qpos[-7:-4] = data.flexvert_xpos.mean(axis=0) + (np.linalg.norm(size) + 0.006) * normal
    if how == "corner":
        turned = Rotation.align_vectors([[0, 0, -1.0]], [np.array(size) / np.linalg.norm(size)])[0]
        data.qpos[-4:] = np.roll(turned.as_quat(), 1)
    data.qvel[-6:-3] = -speed * normal
    data.qvel[-3:] = [30, 40, 0] if how == "spin" else 0
    return model, data


def stays_on_its_side(model, data):
    """Whether the body's centre is on the side of the cloth on which it is now."""
    triangles = model.flex_elem.reshape(-1, 3)

    def angle(data):
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_flex(model, data)
        corners = data.flexvert_xpos[triangles] - data.geom("body").xpos
        a, b, c = corners.transpose(1, 0, 2)
        la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
        top = (a * np.cross(b, c)).sum(axis=1)
        bottom = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
        return np.arctan2(top, bottom).sum()

    begin = np.sign(angle(data))
    return lambda data: np.sign(angle(data)) == begin


@pytest.mark.parametrize("how", ["flat", "corner", "spin"])
@pytest.mark.parametrize(("speed", "timestep"), [(5, 5e-3), (15, 1e-3), (15, 5e-3)])
def test_a_box_stays_on_its_side_of_a_pinned_cloth(how, speed, timestep):
    box = mujoco.mjtGeom.mjGEOM_BOX
    model, data = into_cloth(box, [0.02, 0.015, 0.01], how, speed, timestep)
    run(model, data, 0.04 / speed + 0.015, stays_on_its_side(model, data))


@pytest.mark.parametrize(("speed", "timestep"), [(20, 2e-3), (60, 1e-3), (60, 5e-3)])
def test_an_ellipsoid_does_not_fly_through_a_flag(speed, timestep):
    ellipsoid = mujoco.mjtGeom.mjGEOM_ELLIPSOID
    size = [0.025, 0.01, 0.015]
    model, data = into_cloth(ellipsoid, size, "spin", speed, timestep, "edge")
    run(model, data, 0.04 / speed + 0.015, stays_on_its_side(model, data))


@pytest.mark.parametrize(
    ("radius", "speed", "timestep"), [(5e-4, 5, 2e-3), (1e-3, 10, 5e-3), (2e-3, 20, 1e-3)]
)
def test_a_needle_does_not_go_through_a_small_net(radius, speed, timestep):
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>
      <option timestep="{timestep}" gravity="0 0 0"/><worldbody>
      <flexcomp name="net" type="grid" dim="2" count="6 6 1" spacing=".02 .02 .02" radius=".002"
        mass=".05"><edge equality="true" damping=".001"/><pin id="0 5 30 35"/>
        <contact selfcollide="none"/></flexcomp>
      <body name="body" pos=".005 .008 .04" euler="30 0 0"><freejoint/>
        <geom name="body" type="capsule" size="{radius} .03" mass=".01"/></body>
      </worldbody></mujoco>""")
    data = mujoco.MjData(model)
    data.qvel[-4] = -speed
    mujoco.mj_forward(model, data)
    run(model, data, 0.01 / speed + 0.01, stays_on_its_side(model, data))


def whip(number, links, speed, rng):
    """A chain of thin links on ball joints, about the z axis at its first, and its velocity."""
    chain = ""
    for k in reversed(range(links)):
        joint = '<joint type="ball"/>' if k else '<joint axis="0 0 1"/>'
        place = ".08 0 0" if k else f"-.2 0 {0.05 * number}"
        chain = f"""<body pos="{place}">{joint}<geom name="link{number}{k}" type="capsule"
          fromto=".004 0 0 .076 0 0" size=".003" mass=".02"/>{chain}</body>"""
    return chain, rng.normal(size=3 * links - 2) * speed


@pytest.mark.parametrize("seed", [3, 6])
def test_whips_pass_neither_one_another_nor_a_post_and_redone_steps_add_no_energy(seed):
    rng = np.random.default_rng(seed)
    chains, speeds = zip(*(whip(k, 3 + k, 40.0, rng) for k in range(2)), strict=True)
    post = '<geom name="post" type="cylinder" pos=".1 .1 0" size=".003 .2"/>'
    model = model_of("".join(chains), post, timestep=1e-3)
    data = mujoco.MjData(model)
    data.qvel[:] = np.concatenate(speeds)
    mujoco.mj_forward(model, data)
    guard, tunnelling = GuardedStepper(model, data), Tunnelling(model, data)
    kinetic, change, rolled_back = energies(model, data)[1], 0.0, 0
    for _ in range(60):
        before = sum(energies(model, data))
        report = guard.step(lambda: tunnelling.observe(data))
        assert not report.exhausted
        tunnelling.observe(data)
        assert not tunnelling.pairs
        if report.steps > 1:
            rolled_back += 1
            change += sum(energies(model, data)) - before
            assert change <= 0.02 * kinetic
    assert rolled_back > 0


def test_an_arm_that_is_driven_into_a_plate_stays_above_it():
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>
      <option timestep="5e-3" integrator="implicitfast"/><worldbody>{PLATE.replace(".2 .2", "1 1")}
      <body pos="-.3 0 .3"><joint name="a" axis="0 1 0" armature=".01"/>
      <geom type="capsule" fromto="0 0 0 .3 0 0" size=".01" mass="1"/>
      <body pos=".3 0 0"><joint name="b" axis="0 1 0" armature=".01"/>
      <geom name="tip" type="capsule" fromto="0 0 0 .3 0 0" size=".01" mass="1"/></body></body>
      </worldbody><actuator><motor joint="a"/><motor joint="b"/></actuator></mujoco>""")
    data = mujoco.MjData(model)
    guard, touched = GuardedStepper(model, data), 0
    for _ in range(100):
        data.ctrl[:] = 80, 40
        report = guard.step()
        assert not report.exhausted
        touched += report.contacts > 0
        mujoco.mj_kinematics(model, data)
        axis = data.geom("tip").xmat.reshape(3, 3)[:, 2]
        assert data.geom("tip").xpos[2] - 0.15 * abs(axis[2]) > 0
    assert touched > 20
