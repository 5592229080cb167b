"""The compiled loop against the same loop written plainly in Python."""

import gc
import weakref
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from tauguard.envs import Gains, SimulationDiverged, SimulationLoop, random_motion
from tauguard.envs.episodes.simulate import workspace
from tauguard.envs.plant import make_plant
from tauguard.models import SceneSpec, compose, cura6_drive


@pytest.fixture(scope="module")
def scene():
    return compose(SceneSpec(labels=False))


@pytest.fixture(scope="module")
def motion(scene):
    return random_motion(np.random.default_rng(4), workspace(scene), 1.5, 60.0)


def plain_loop(scene, nominal, gains, motion, tau_ff):
    """What the compiled loop should do, in a few lines of Python."""
    model, data, drive = scene.model, mujoco.MjData(scene.model), scene.drive
    data.qpos[scene.qpos_adr] = motion.q[0]
    mujoco.mj_forward(model, data)
    dt = model.opt.timestep
    n = len(scene.joint_names)
    current, bristle = np.zeros(n), np.zeros(n)
    rows = []
    for k in range(len(motion.t)):
        q, qd = data.qpos[scene.qpos_adr].copy(), data.qvel[scene.dof_adr].copy()
        wanted = tau_ff[k] + gains.kp * (motion.q[k] - q) + gains.kd * (motion.qd[k] - qd)
        command = np.clip(wanted / nominal.gain, -drive.current_limit, drive.current_limit)
        lag = np.exp(-dt / drive.electrical_time_constant) if drive.electrical_time_constant else 0
        current = command + (current - command) * lag
        tau = drive.gain * current
        applied = tau.copy()
        if drive.friction is not None:
            f = drive.friction
            warm = f.temperature - f.reference_temperature
            level = f.coulomb + (f.static - f.coulomb) * np.exp(-((qd / f.stribeck_velocity) ** 2))
            level *= (1 + f.load * np.abs(tau)) * (1 + f.coulomb_per_kelvin * warm)
            settled = np.sign(qd) * level / f.bristle_stiffness
            decay = np.exp(-f.bristle_stiffness * np.abs(qd) / level * dt)
            bristle = np.where(qd == 0, bristle, settled + (bristle - settled) * decay)
            applied -= f.bristle_stiffness * bristle
            applied -= f.viscous * (1 + f.viscous_per_kelvin * warm) * qd
        if drive.ripple is not None:
            r = drive.ripple
            angle = r.cycles * (drive.gear * q)[:, None] + r.phase
            applied += drive.gain * (r.amplitude * np.sin(angle)).sum(axis=1)
        data.qfrc_applied[scene.dof_adr] = applied
        rows.append((q, qd, current.copy()))
        mujoco.mj_step(model, data)
    return (np.array(column) for column in zip(*rows, strict=True))


@pytest.mark.parametrize("parts", ["everything", "ideal", "no ripple", "no friction"])
def test_equals_a_plain_python_loop(scene, motion, parts):
    drive = scene.drive
    if parts in ("ideal", "no friction"):
        drive = replace(drive, friction=None)
    if parts in ("ideal", "no ripple"):
        drive = replace(drive, ripple=None)
    if parts == "ideal":
        drive = replace(drive, electrical_time_constant=None)
    built = replace(scene, drive=drive)
    loop = SimulationLoop(built, cura6_drive())
    loop.reset(motion.q[0])
    tau_ff = np.zeros_like(motion.q)
    got = loop.run(motion.q, motion.qd, tau_ff)
    q, qd, current = plain_loop(built, cura6_drive(), loop.gains, motion, tau_ff)
    np.testing.assert_allclose(got.q, q, atol=1e-9)
    np.testing.assert_allclose(got.qd, qd, atol=1e-7)
    np.testing.assert_allclose(got.current, current, atol=1e-6)


def test_restoring_repeats_the_same_bits(scene, motion):
    loop = SimulationLoop(scene, cura6_drive())
    loop.reset(motion.q[0])
    zero = np.zeros_like(motion.q)
    loop.run(motion.q[:500], motion.qd[:500], zero[:500])
    saved = loop.save()
    first = loop.run(motion.q[500:], motion.qd[500:], zero[500:])
    loop.restore(saved)
    again = loop.run(motion.q[500:], motion.qd[500:], zero[500:])
    np.testing.assert_array_equal(first.q, again.q)
    np.testing.assert_array_equal(first.current, again.current)


def test_a_joint_held_below_breakaway_stays(scene):
    """Static friction carries a load below its level: the arm creeps by less than its bristles."""
    friction = scene.drive.friction
    assert friction is not None
    level = scene.model.opt.gravity.copy()
    try:
        scene.model.opt.gravity[:] = 0
        loop = SimulationLoop(scene, cura6_drive(), Gains(np.zeros(6), np.zeros(6)))
        start = np.array(workspace(scene).low)
        loop.reset(start)
        push = np.tile(0.5 * friction.coulomb, (1000, 1))
        still = np.zeros_like(push)
        got = loop.run(still, still, push)
    finally:
        scene.model.opt.gravity[:] = level
    reach = friction.static / friction.bristle_stiffness
    assert (np.abs(got.q[-1] - start) < 3 * reach).all()


def test_divergence_is_named(scene, motion):
    loop = SimulationLoop(scene, cura6_drive())
    loop.reset(motion.q[0])
    loop.data.qvel[:] = 1e5
    with pytest.raises(SimulationDiverged, match="smaller timestep"):
        loop.run(motion.q, motion.qd, np.zeros_like(motion.q))


def test_the_plant_keeps_what_it_steps(scene, motion):
    """Data and rows live as long as the plant that writes to them."""
    data = mujoco.MjData(scene.model)
    gone = weakref.ref(data)
    plant = make_plant(scene, cura6_drive(), Gains.for_scene(scene), data)
    del data
    gc.collect()
    assert gone() is not None
    assert len(plant.state()) == len(plant.state())
    plant.restore(plant.state())
    with pytest.raises(ValueError, match="another scene"):
        plant.restore([0.0])
    del plant
    gc.collect()
    assert gone() is None
