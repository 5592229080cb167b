"""Force validation: a blow against a body region beside the two masses and one spring on paper.

``rail``: a mass on a rail against every region, over time step, integrator and contact parameters:
the error of peak force and transferred energy against the cost. ``arm``: links of the arm against
regions: the peak of a limp arm beside the one that its reflected mass predicts and the one of the
standard's M/2 + m_L, and how much more a position-controlled arm presses, which is drive force.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from tauguard.envs import SimulationLoop
from tauguard.models import (
    BODY_REGIONS,
    BodyProxy,
    Drive,
    Scene,
    SceneSpec,
    blow_velocity,
    compose,
    reflected_mass,
    standard_mass,
)
from tauguard.report import Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: What stands on the rail [kg] and how fast it comes [m/s].
RAIL_MASS, SPEED = 12.0, 0.25
RADIUS, PROXY_RADIUS, GAP = 0.05, 0.07, 5e-4
RAIL = f"""<mujoco><worldbody><body name="sled"><joint name="rail" type="slide" axis="1 0 0"/>
  <geom type="sphere" size="{RADIUS}" mass="{RAIL_MASS}"/></body></worldbody></mujoco>"""
TIMESTEPS = (2.5e-4, 5e-4, 1e-3, 2e-3)
#: Directions around a link to try.
SIDES = 12
#: Contact parameters beside the composer's: how its stiffness is told to MuJoCo.
CONTACTS = ("direct", "direct, hard solimp", "MuJoCo's default")
_HARD, _DEFAULT = (0.9, 0.95, 0.001, 0.5, 2.0), (0.02, 1.0)

#: What the columns of each table mean.
NOTES = {
    "rail": "a mass on a rail against each region; the errors are shares of the two-mass model's "
    "closed form, worst of the regions, energy_error of the energy taken by the spring. direct: "
    "the stiffness told to MuJoCo as such.",
    "arm": "a link strikes a region at 0.25 m/s. inertial_peak_n: the limp arm; predicted_n: by "
    "its reflected mass, error: between both; standard_n: by half the moving mass and the load; "
    "driven_peak_n: with the drives holding their course, which neither predicts. The regions are "
    "the standard's springs, not tissue.",
    "asked": "what the model must keep, beside what it kept; errors are shares.",
}


def measure(quick: bool, seed: int) -> list[Row]:
    """Rows of the studies ``rail`` and ``arm``; nothing is drawn at random, ``seed`` is unused."""
    del seed
    regions = ("face", "hand", "chest", "back") if quick else tuple(BODY_REGIONS)
    rows = rail(regions) + arm(("hand", "chest") if quick else regions)
    return rows + answers(rows, regions)


def answers(rows: list[Row], regions: tuple[str, ...]) -> list[Row]:
    """What the validation must show, beside what was measured."""
    default = next(
        row
        for row in rows
        if (row["study"], row["timestep_ms"], row["integrator"], row["contact"])
        == ("rail", 1e3 * SceneSpec.timestep, SceneSpec.integrator, CONTACTS[0])
    )
    struck = max(row["error"] for row in rows if row["study"] == "arm")
    found = [
        (
            f"peak force at the default, worst of {len(regions)} regions",
            default["peak_force_error"],
        ),
        ("peak force of the limp arm against its reflected mass, worst", struck),
    ]
    return [
        {"study": "asked", "what": what, "asked": "error <= 0.02", "measured": error}
        for what, error in found
    ]


@dataclass(frozen=True)
class Blow:
    """What a simulated blow came to."""

    force: float  #: peak [N]
    energy: float  #: largest kinetic energy that left both bodies, into the spring [J]
    micros: float  #: wall clock a simulated millisecond [us]


def rail(regions: tuple[str, ...]) -> list[Row]:
    """Worst errors over the regions, for each time step, integrator and kind of contact."""
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rail.xml"
        path.write_text(RAIL)
        cases = [(step, "implicitfast", "direct") for step in TIMESTEPS]
        cases += [(1e-3, kind, "direct") for kind in ("euler", "implicit", "rk4", "discrete")]
        cases += [(1e-3, "implicitfast", contact) for contact in CONTACTS[1:]]
        for step, integrator, contact in cases:
            found = {
                name: _rail_blow(str(path), name, step, integrator, contact) for name in regions
            }
            force = {n: b.force / _paper_force(n) - 1 for n, b in found.items()}
            energy = {n: b.energy / _paper_energy(n) - 1 for n, b in found.items()}
            worst = max(force, key=lambda name: abs(force[name]))
            rows.append(
                {
                    "study": "rail",
                    "timestep_ms": 1e3 * step,
                    "integrator": integrator,
                    "contact": contact,
                    "peak_force_error": abs(force[worst]),
                    "worst_region": worst,
                    "energy_error": max(map(abs, energy.values())),
                    "us_per_simulated_ms": float(np.median([b.micros for b in found.values()])),
                }
            )
    return rows


def _paper_force(region: str) -> float:
    return BODY_REGIONS[region].peak_force(SPEED, RAIL_MASS)


def _paper_energy(region: str) -> float:
    """All kinetic energy of the relative motion, mu v^2 / 2, which is F^2 / 2k."""
    return _paper_force(region) ** 2 / (2 * BODY_REGIONS[region].stiffness)


def _rail_blow(path: str, region: str, timestep: float, integrator: str, contact: str) -> Blow:
    proxy = BodyProxy(region, (RADIUS + PROXY_RADIUS + GAP, 0, 0), radius=PROXY_RADIUS)
    scene = compose(
        SceneSpec(
            timestep=timestep,
            gravity=(0, 0, 0),
            arm=path,
            integrator=integrator,
            proxies=(proxy,),
        )
    )
    _set_contact(scene.model, contact)
    data = mujoco.MjData(scene.model)
    data.qvel[0] = SPEED
    return _watch(scene, data, seconds=0.4)


def _set_contact(model: mujoco.MjModel, contact: str) -> None:
    if contact == CONTACTS[1]:
        model.pair_solimp[:] = _HARD
    elif contact == CONTACTS[2]:
        model.pair_solref[:] = _DEFAULT
        model.pair_solimp[:] = _HARD


def _watch(scene: Scene, data: mujoco.MjData, seconds: float) -> Blow:
    """Step until the blow is over, looking at force and kinetic energy at every step."""
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
    return Blow(force, energy, min(taken) * 1e6 / (1e3 * seconds))


def _kinetic(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    moved = np.zeros(model.nv)
    mujoco.mj_mulM(model, data, moved, data.qvel)
    return float(data.qvel @ moved) / 2


def _contact_force(data: mujoco.MjData) -> float:
    return float(np.linalg.norm(data.sensordata.reshape(-1, 10)[:, 1:4].sum(axis=0)))


@dataclass(frozen=True)
class Strike:
    """A link of the arm about to strike a region: the scene and where they will meet."""

    scene: Scene
    q: np.ndarray
    body: int
    point: np.ndarray
    normal: np.ndarray


def arm(regions: tuple[str, ...], links: tuple[int, ...] = (4, 5, 6)) -> list[Row]:
    """Inertial and driven peak of links that strike regions, beside both predictions."""
    rows: list[Row] = []
    for link in links:
        for region in regions:
            strike = aimed(region, link)
            limits = BODY_REGIONS[region]
            at = (strike.scene, strike.q, strike.body, strike.point, strike.normal)
            heavy, simple = reflected_mass(*at), standard_mass(strike.scene)
            qd = blow_velocity(*at, SPEED)
            limp = _limp(strike, qd)
            predicted = limits.peak_force(SPEED, heavy)
            rows.append(
                {
                    "study": "arm",
                    "link": link,
                    "region": region,
                    "reflected_mass_kg": heavy,
                    "standard_mass_kg": simple,
                    "inertial_peak_n": limp.force,
                    "predicted_n": predicted,
                    "error": abs(limp.force / predicted - 1),
                    "standard_n": limits.peak_force(SPEED, simple),
                    "driven_peak_n": _driven(strike, qd),
                    "us_per_simulated_ms": limp.micros,
                }
            )
    return rows


def aimed(region: str, link: int) -> Strike:
    """The arm at home without gravity, and the region's proxy half a millimetre before a link.

    The proxy stands beside the middle of the link's first shape, on the first side of it that
    nothing else of the arm is near.

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
            return Strike(scene, bare.home, body, point, normal)
    raise ValueError(f"link {link}: no free side to strike with at the home pose")


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


def _limp(strike: Strike, qd: np.ndarray) -> Blow:
    """The arm coasts: what presses is its inertia alone."""
    scene = strike.scene
    data = mujoco.MjData(scene.model)
    data.qpos[scene.qpos_adr] = strike.q
    data.qvel[scene.dof_adr] = qd
    return _watch(scene, data, seconds=0.15)


def _driven(strike: Strike, qd: np.ndarray) -> float:
    """Peak force of the arm under position control that goes on for 0.15 s [N]."""
    scene = strike.scene
    loop = SimulationLoop(scene, scene.drive)
    loop.reset(strike.q)
    loop.data.qvel[scene.dof_adr] = qd
    times = np.arange(round(0.15 / scene.model.opt.timestep)) * scene.model.opt.timestep
    path = strike.q + times[:, None] * qd
    seen = loop.run(path, np.broadcast_to(qd, path.shape), np.zeros_like(path))
    return float(np.linalg.norm(seen.contact[:, :, 1:4].sum(axis=1), axis=1).max())


def draw(rows: list[Row], figure: Figure) -> None:
    """Error against cost over the contact's parameters; peaks of the arm beside predictions."""
    left, right = figure.subplots(1, 2)
    for row in (row for row in rows if row["study"] == "rail"):
        plain = row["integrator"] == "implicitfast" and row["contact"] == "direct"
        other = row["contact"] if row["contact"] != "direct" else row["integrator"]
        at = (row["us_per_simulated_ms"], 100 * row["peak_force_error"])
        left.loglog(*at, "o" if plain else "s", color="C0" if plain else "C1")
        if other in ("euler", "implicit"):
            continue  # on top of the default
        label = f"{row['timestep_ms']:g} ms" if plain else f"{other}, 1 ms"
        place = dict(xytext=(-6, -12)) if label == "1 ms" else dict(xytext=(7, 0))
        left.annotate(label, at, **place, textcoords="offset points", fontsize=8, va="center")
    left.margins(x=0.25)
    left.axhline(2, color="0.5", lw=0.8, ls="--")
    left.set(
        xlabel="microseconds per simulated millisecond",
        ylabel="worst error of the peak force over the regions [%]",
        title="Two masses, one spring: error against cost",
    )
    found = [row for row in rows if row["study"] == "arm"]
    names = [f"link {row['link']}, {row['region']}" for row in found]
    height = np.arange(len(found))
    for k, (key, label, color) in enumerate(
        (
            ("inertial_peak_n", "limp arm", "C0"),
            ("predicted_n", "by the reflected mass", "#7ad151"),
            ("standard_n", "by M/2 + m_L", "#b5b5b5"),
            ("driven_peak_n", "position-controlled", "C1"),
        )
    ):
        right.barh(
            height + 0.2 * k - 0.3, [row[key] for row in found], 0.2, label=label, color=color
        )
    right.set_yticks(height, names, fontsize=8)
    right.invert_yaxis()
    right.set(xlabel="peak force [N]", title=f"The arm strikes at {SPEED:g} m/s")
    right.legend(fontsize=8)
