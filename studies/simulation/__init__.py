"""Simulation and environments: what each modelled thing costs, and what a step's length costs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from studies.framework import Part, Point, Study, number, table_rows
from tauguard.report import Row

STUDY = Study(
    "what each modelled thing of a scene costs and brings, and the environments around it",
    {
        "scene": Part(
            "simulation.scene",
            "what each part of a scene costs, and what the time step costs in accuracy",
        ),
        "needs": Part(
            "simulation.needs",
            "model only what a scene needs: parts left out, and what the detector then does",
            alias="needs",
        ),
        "impact": Part(
            "simulation.impact",
            "impacts on body regions beside the two-mass model: error against cost",
            alias="impact",
        ),
        "environments": Part(
            "simulation.environments",
            "what an environment costs beside its physics, many at once, and reactions",
            alias="environments",
        ),
        "arms": Part(
            "simulation.arms",
            "any arm: servo, residual, divergences, false alarms and a strike, arm by arm",
            ("robot",),
            alias="arms",
        ),
    },
)


def points(rows: Sequence[Row]) -> Iterator[Point]:
    """Time steps of the arm, impacts on a rail, and an environment's step beside rollout's."""
    for row in table_rows(rows, "timestep"):
        question = "Time step of the arm under position control"
        yield from _point(
            row, question, f"{row['timestep_ms']:g} ms", "q_error_rad", "largest joint error [rad]"
        )
    for row in table_rows(rows, "rail"):
        method = ", ".join(str(row[key]) for key in ("timestep_ms", "integrator", "contact"))
        question, axis = "An impact on a rail beside the two-mass model", "error of the peak force"
        yield from _point(row, question, method, "peak_force_error", axis)
    steps = table_rows(rows, "step")
    peers = [row for row in steps if str(row.get("what")).startswith("mujoco.rollout")]
    for own in (row for row in steps if row.get("what") == "the environment"):
        question = "10 ms of an arm with drives, observations and rewards"
        if not peers:
            raise ValueError("no row of mujoco.rollout")
        strayed, us = peers[0]["q_difference_rad"], number(own["us_per_action"]) or 0.0
        error = f"joints within {f'{strayed:.0e}' if strayed else '0'} rad of rollout's"
        yield Point(question, "the environment", us, math.nan, error, "ours")
        us, method = number(peers[0]["us_per_action"]) or 0.0, "mujoco.rollout of the bare physics"
        yield Point(question, method, us, math.nan, "same motion", "peer")


def _point(row: Row, question: str, method: str, error: str, axis: str) -> Iterator[Point]:
    us, found = number(row.get("us_per_simulated_ms")), number(row.get(error))
    if us and found is not None:
        per_ms = "microseconds per simulated millisecond"
        yield Point(question, method, us, abs(found), "", "", per_ms, axis)
