"""Speed against error: a room for each family of studies, one table and one figure each.

A study is a module of ``studies`` with two functions::

    def run(quick: bool, seed: int) -> list[dict[str, object]]   # flat rows
    def draw(rows: list[dict[str, object]], figure: matplotlib.figure.Figure) -> None

and, where the rows are too many to print, ``shown(rows) -> rows``: what is printed instead. Its
``NOTES: dict[str, str]`` say above each table (by the rows' ``study``) what the columns mean.
"""

from typing import NamedTuple


class Study(NamedTuple):
    """Where a study is and what it answers."""

    module: str
    line: str


#: Every study: its module and its one-line description, in the order of ``tauguard bench list``.
STUDIES: dict[str, Study] = {
    "simulation": Study(
        "simulation.study",
        "what each part of a scene costs, and what the time step costs in accuracy",
    ),
    "needs": Study(
        "simulation.needs",
        "model only what a scene needs: parts left out, and what the detector then does",
    ),
    "impact": Study(
        "simulation.impact",
        "blows against body regions beside the two-mass model: error against cost",
    ),
    "detection_conformal": Study(
        "detection.conformal",
        "false alarms per hour: what calibration guarantees, and what is counted",
    ),
    "false_alarms": Study(
        "detection.false_alarms",
        "thresholds for a rate of false alarms, on ten arms of fresh seeds",
    ),
    "detection_parts": Study(
        "detection.parts",
        "what each part of the detector brings: left out, everything else stays",
    ),
    "detection_ladder": Study(
        "detection.ladder",
        "from the dissertation's setting to ours: one change at a time",
    ),
    "detection_online": Study(
        "detection.online", "observer and SVR a sample: microseconds, and fewer support vectors"
    ),
    "environments": Study(
        "simulation.environments",
        "what an environment costs beside its physics, many at once, and reactions",
    ),
    "arms": Study(
        "simulation.arms",
        "any arm: servo, residual, divergences, false alarms and a strike, arm by arm",
    ),
    "datasets": Study(
        "datasets.study",
        "generation: rate beside mujoco.rollout, bytes, reading, memory",
    ),
    "entries": Study(
        "datasets.entries",
        "every detector on tauguard-collisions-v1, and trained by path beside from traces",
    ),
    "rigid": Study(
        "rigid.study",
        "convex overlap by elimination (ABFME) and axes, meshes, time of impact, beside coal",
    ),
    "contacts": Study(
        "contacts.study",
        "contact checkers beside MuJoCo and a referee: what each sees, when, at what cost",
    ),
    "guard": Study(
        "contacts.guard",
        "guarded steps on scenes drawn at random, beside MuJoCo's modes and fine fixed steps",
    ),
    "cloth": Study(
        "cloth.study",
        "whole frames of deforming meshes: methods, volumes, front, growth, beside ipctk",
    ),
    "diagnosis": Study(
        "detection.diagnosis",
        "after the alarm: link, force, point and kind of event against the truth",
    ),
    "real_arm": Study(
        "real_arm.study",
        "logs of real arms: pushes found, delays and false alarms, beside three simple rules",
    ),
    "faults": Study(
        "faults.study",
        "faults of samples: which are seen, how soon, false alarms, and those not reported",
    ),
    "listen": Study(
        "faults.live",
        "a log played by RTDE in real time and heard: losses, alarms, latency",
    ),
    "detection": Study(
        "detection.study",
        "the dissertation's experiment: detectors, speeds, operating points, false alarms",
    ),
}

#: What was a study and is a slow test now: its name there.
SLOW_TESTS = {
    "mutants": "damaged",
    "kills": "'interrupted or generate'",
    "endurance": "endurance",
}
