"""Impacts whose peak force is known in closed form: two masses and one spring.

A mass on a rail, or a link of an arm without gravity, hits a body region at :data:`SPEED`.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np

from tauguard.envs import SimulationLoop
from tauguard.models import BODY_REGIONS, BodyProxy, Drive, Scene, SceneSpec, compose

#: Mass on the rail [kg] and its speed [m/s].
RAIL_MASS, SPEED = 12.0, 0.25
#: Radii of the mass and of the region's proxy, and their distance at the start [m].
RADIUS, PROXY_RADIUS, GAP = 0.05, 0.07, 5e-4
RAIL = f"""<mujoco><worldbody><body name="sled"><joint name="rail" type="slide" axis="1 0 0"/>
  <geom type="sphere" size="{RADIUS}" mass="{RAIL_MASS}"/></body></worldbody></mujoco>"""
#: Directions around a link to try.
SIDES = 12
#: Contact parameters: the composer's, and two others.
CONTACTS = ("direct", "direct, hard solimp", "MuJoCo's default")
_HARD, _DEFAULT = (0.9, 0.95, 0.001, 0.5, 2.0), (0.02, 1.0)


@dataclass(frozen=True)
class Impact:
    """Result of a simulated impact."""

    force: float  #: peak [N]
    energy: float  #: largest decrease of kinetic energy: what the spring stores [J]
    micros: float  #: wall time of a simulated millisecond [us]


def predicted_force(region: str) -> float:
    """Peak force of the two-mass model for the mass on the rail [N]."""
    return BODY_REGIONS[region].peak_force(SPEED, RAIL_MASS)


def predicted_energy(region: str) -> float:
    """Kinetic energy of the relative motion, mu v^2 / 2, which is F^2 / 2k [J]."""
    return predicted_force(region) ** 2 / (2 * BODY_REGIONS[region].stiffness)


def rail_impact(region: str, timestep: float, integrator: str, contact: str) -> Impact:
    """A mass on a rail against a region, with one of :data:`CONTACTS`."""
    proxy = BodyProxy(region, (RADIUS + PROXY_RADIUS + GAP, 0, 0), radius=PROXY_RADIUS)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rail.xml"
        path.write_text(RAIL)
        spec = SceneSpec(timestep=timestep, gravity=(0, 0, 0), arm=str(path), integrator=integrator)
        scene = compose(replace(spec, proxies=(proxy,)))
    _set_contact(scene.model, contact)
    data = mujoco.MjData(scene.model)
    data.qvel[0] = SPEED
    return observed(scene, data, seconds=0.4)


def _set_contact(model: mujoco.MjModel, contact: str) -> None:
    if contact == CONTACTS[1]:
        model.pair_solimp[:] = _HARD
    elif contact == CONTACTS[2]:
        model.pair_solref[:] = _DEFAULT
        model.pair_solimp[:] = _HARD


def observed(scene: Scene, data: mujoco.MjData, seconds: float) -> Impact:
    """Force and kinetic energy at every step of the impact."""
    model = scene.model
    mujoco.mj_forward(model, data)
    start = _kinetic(model, data)
    force, energy, steps = 0.0, 0.0, round(seconds / model.opt.timestep)
    for _ in range(steps):
        mujoco.mj_step(model, data)
        force = max(force, _contact_force(data))
        energy = max(energy, start - _kinetic(model, data))
    taken = []
    for _ in range(3):
        begin = time.perf_counter()
        mujoco.mj_step(model, data, nstep=steps)
        taken.append(time.perf_counter() - begin)
    return Impact(force, energy, min(taken) * 1e6 / (1e3 * seconds))


def _kinetic(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    moved = np.zeros(model.nv)
    mujoco.mj_mulM(model, data, moved, data.qvel)
    return float(data.qvel @ moved) / 2


def _contact_force(data: mujoco.MjData) -> float:
    return float(np.linalg.norm(data.sensordata.reshape(-1, 10)[:, 1:4].sum(axis=0)))


@dataclass(frozen=True)
class LinkImpact:
    """A link of the arm just before it hits a region: the scene and the point of contact."""

    scene: Scene
    q: np.ndarray
    body: int
    point: np.ndarray
    normal: np.ndarray


def aimed(region: str, link: int) -> LinkImpact:
    """The arm at home without gravity, and the region's proxy half a millimetre before a link.

    The proxy is placed beside the middle of the link's first shape, on the first side where no
    other part of the arm is near.

    Raises:
        ValueError: no side of the link is free.
    """
    spec = SceneSpec(gravity=(0, 0, 0), drive=Drive.ideal(np.full(6, 1e3)))
    bare = compose(spec)
    model, data = bare.model, mujoco.MjData(bare.model)
    data.qpos[bare.qpos_adr] = bare.home
    mujoco.mj_forward(model, data)
    body = int(bare.link_bodies[link - 1])
    geom = next(
        g for g in range(model.ngeom) if model.geom_bodyid[g] == body and model.geom_contype[g]
    )
    radius, frame = float(model.geom_size[geom, 0]), data.geom_xmat[geom].reshape(3, 3)
    for angle in np.arange(SIDES) * 2 * np.pi / SIDES:
        normal = frame @ [np.cos(angle), np.sin(angle), 0.0]
        x, y, z = data.geom_xpos[geom] + normal * (radius + PROXY_RADIUS + GAP)
        along = (float(normal[0]), float(normal[1]), float(normal[2]))
        proxy = BodyProxy(region, (x, y, z), along, radius=PROXY_RADIUS)
        scene = compose(replace(spec, proxies=(proxy,)))
        if _alone(scene, link, region):
            point = data.geom_xpos[geom] + normal * radius
            return LinkImpact(scene, bare.home, body, point, normal)
    raise ValueError(f"link {link}: no side is free for an impact at the home pose")


def _alone(scene: Scene, link: int, region: str) -> bool:
    """Whether one shape of the link, and nothing else of the arm, is within 2 cm of the proxy."""
    model, data = scene.model, mujoco.MjData(scene.model)
    data.qpos[scene.qpos_adr] = scene.home
    mujoco.mj_forward(model, data)
    other = model.geom(region).id
    near = [
        int(g)
        for g in model.pair_geom1
        if mujoco.mj_geomDistance(model, data, int(g), other, 0.02, None) < 0.02
    ]
    return [int(model.geom_bodyid[g]) for g in near] == [int(scene.link_bodies[link - 1])]


def limp_impact(at: LinkImpact, qd: np.ndarray) -> Impact:
    """The arm without drives: only its inertia acts."""
    scene = at.scene
    data = mujoco.MjData(scene.model)
    data.qpos[scene.qpos_adr] = at.q
    data.qvel[scene.dof_adr] = qd
    return observed(scene, data, seconds=0.15)


def driven_peak(at: LinkImpact, qd: np.ndarray) -> float:
    """Peak force of the arm whose position control continues for 0.15 s [N]."""
    scene = at.scene
    loop = SimulationLoop(scene, scene.drive)
    loop.reset(at.q)
    loop.data.qvel[scene.dof_adr] = qd
    times = np.arange(round(0.15 / scene.model.opt.timestep)) * scene.model.opt.timestep
    path = at.q + times[:, None] * qd
    seen = loop.run(path, np.broadcast_to(qd, path.shape), np.zeros_like(path))
    return float(np.linalg.norm(seen.contact[:, :, 1:4].sum(axis=1), axis=1).max())
