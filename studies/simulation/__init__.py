"""Simulation and environments: computing time of their parts, error against time step."""

import math
from collections.abc import Iterator, Sequence

from studies.framework import Part, Point, Study, number, table_rows
from tauguard.report import Row

STUDY = Study(
    "computing time and effect of each part of a simulation, and of environments",
    {
        "scene": Part(
            "simulation.scene",
            "computing time of each part of a scene; error for each length of the time step",
        ),
        "needs": Part(
            "simulation.needs",
            "scenes without some of their parts: computing time and effect on the detector",
            alias="needs",
        ),
        "impact": Part(
            "simulation.impact",
            "impacts on body regions: error against the two-mass model, computing time",
            alias="impact",
        ),
        "permissible_speed": Part(
            "simulation.permissible_speed",
            "forces on a person beside MuJoCo's, at any speed and at the permissible one",
            alias="speed",
        ),
        "environments": Part(
            "simulation.environments",
            "time of environments beyond their physics, also in parallel; reactions to alarms",
            alias="environments",
        ),
    },
)


def points(rows: Sequence[Row]) -> Iterator[Point]:
    """Time and error: steps of the arm, impacts on a rail, an environment beside rollout."""
    for row in table_rows(rows, "timestep"):
        name, axis = f"{row['timestep_ms']:g} ms", "largest joint error [rad]"
        yield from _point(
            row, "Time step of the arm under position control", name, "q_error_rad", axis
        )
    for row in table_rows(rows, "rail"):
        name = ", ".join(str(row[key]) for key in ("timestep_ms", "integrator", "contact"))
        question, axis = "An impact on a rail beside the two-mass model", "error of the peak force"
        yield from _point(row, question, name, "peak_force_error", axis)
    steps = {str(row["what"]): row for row in table_rows(rows, "step")}
    if steps:
        question = "10 ms of an arm with drives, observations and rewards"
        peer, own = steps["mujoco.rollout, forces given"], steps["the environment"]
        us = [number(row["us_per_action"]) or 0.0 for row in (own, peer)]
        error = f"joints within {peer['q_difference_rad']:.0e} rad of rollout's"
        yield Point(question, "the environment", us[0], math.nan, error, "ours")
        method = "mujoco.rollout of the bare physics"
        yield Point(question, method, us[1], math.nan, "same motion")


def _point(row: Row, question: str, method: str, error: str, axis: str) -> Iterator[Point]:
    us, found = number(row.get("us_per_simulated_ms")), number(row.get(error))
    if us and found is not None:
        per_ms = "microseconds per simulated millisecond"
        yield Point(question, method, us, abs(found), "", "", per_ms, axis)
