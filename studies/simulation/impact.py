"""Impacts on body regions beside the standard's model of two masses and one spring.

In ``rail`` a mass on a rail hits every region, over time steps, integrators and contact parameters.
The row gives the errors of peak force and transferred energy, and the cost. In ``arm`` links of the
arm hit regions. The peak force without drives stands beside the predictions from the arm's
reflected mass and from the standard's mass M/2 + m_L. The last column is the peak force under
position control.
"""

import numpy as np

from oracles import two_mass_impact as impacts
from oracles.two_mass_impact import CONTACTS, SPEED
from studies.framework import answer, table_rows
from tauguard.models import BODY_REGIONS, SceneSpec, impact_velocity, reflected_mass, standard_mass
from tauguard.report import Row

TIMESTEPS = (2.5e-4, 5e-4, 1e-3, 2e-3)
NOTES = {
    "rail": "a mass on a rail hits each region. Errors are fractions of the closed form of the "
    "two-mass model, for the worst region; energy_error: of the energy stored in the spring. "
    "direct: MuJoCo gets the stiffness directly.",
    "arm": "a link hits a region at 0.25 m/s. inertial_peak_n: without drives; predicted_n: from "
    "its reflected mass, error: relative difference; standard_n: from half the moving mass and "
    "the load; driven_peak_n: under position control, without a prediction. The regions are "
    "the springs of the standard.",
}


def measure(quick: bool, seed: int) -> list[Row]:
    """Rows of ``rail`` and ``arm``; nothing is random, ``seed`` is unused."""
    del seed
    regions = ("face", "hand", "chest", "back") if quick else tuple(BODY_REGIONS)
    return rail(regions) + arm(("hand", "chest") if quick else regions)


def judge(rows: list[Row]) -> list[Row]:
    """Judge the error on the rail at the default settings, and of the arm without drives."""
    default = (1e3 * SceneSpec.timestep, SceneSpec.integrator, CONTACTS[0])
    at_default = [
        row["peak_force_error"]
        for row in table_rows(rows, "rail")
        if (row["timestep_ms"], row["integrator"], row["contact"]) == default
    ]
    errors = {
        "peak force on the rail at the default, worst region": max(at_default),
        "peak force of the arm without drives, worst": max(
            row["error"] for row in table_rows(rows, "arm")
        ),
    }
    return [
        answer(question, "error <= 0.02", f"{error:.2g}", error <= 0.02)
        for question, error in errors.items()
    ]


def rail(regions: tuple[str, ...]) -> list[Row]:
    """Worst errors over the regions, for each time step, integrator and kind of contact."""
    cases = [(step, "implicitfast", "direct") for step in TIMESTEPS]
    cases += [(1e-3, kind, "direct") for kind in ("euler", "implicit", "rk4", "discrete")]
    cases += [(1e-3, "implicitfast", contact) for contact in CONTACTS[1:]]
    rows: list[Row] = []
    for step, integrator, contact in cases:
        found = {name: impacts.rail_impact(name, step, integrator, contact) for name in regions}
        force = {n: abs(i.force / impacts.predicted_force(n) - 1) for n, i in found.items()}
        energy = [abs(i.energy / impacts.predicted_energy(n) - 1) for n, i in found.items()]
        worst = max(force, key=lambda name: force[name])
        rows.append(
            {
                "study": "rail",
                "timestep_ms": 1e3 * step,
                "integrator": integrator,
                "contact": contact,
                "peak_force_error": force[worst],
                "worst_region": worst,
                "energy_error": max(energy),
                "us_per_simulated_ms": float(np.median([i.micros for i in found.values()])),
            }
        )
    return rows


def arm(regions: tuple[str, ...], links: tuple[int, ...] = (4, 5, 6)) -> list[Row]:
    """Peaks of links with and without drives, beside both predictions."""
    rows: list[Row] = []
    for link, region in ((link, region) for link in links for region in regions):
        hit, limits = impacts.aimed(region, link), BODY_REGIONS[region]
        at = (hit.scene, hit.q, hit.body, hit.point, hit.normal)
        heavy, simple = reflected_mass(*at), standard_mass(hit.scene)
        qd = impact_velocity(*at, SPEED)
        limp, predicted = impacts.limp_impact(hit, qd), limits.peak_force(SPEED, heavy)
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
                "driven_peak_n": impacts.driven_peak(hit, qd),
                "us_per_simulated_ms": limp.micros,
            }
        )
    return rows
