"""Whether a detector keeps the guarantee of its conformal calibration on fresh motion.

Episodes of collision-free motion are drawn alike: speed, payload (not known), temperature and path
at random. Some calibrate the threshold for a number of false alarms per hour, others are fresh. The
guarantee is kept where the rate asked for lies inside or above the exact Poisson 95 % interval of
the alarms counted. The same pool is then split anew, again and again: how many draws kept it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tauguard.report import Row
from tauguard.report.charts import errorbars

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tauguard.detectors import FittedDetector
    from tauguard.detectors.thresholds.free_scores import FreeScores
    from tauguard.envs import Episode
    from tauguard.models import Mismatch

#: Detectors of the study when it runs by itself.
NAMES = ("srq-svr", "moving-thresholds", "residual-thresholds", "current-network")

#: What the columns of each table mean.
NOTES = {
    "conformal": "a threshold from calibration motion guarantees asked_per_hour; "
    "false_alarms_per_hour counts what came in fresh_hours of fresh motion, drawn alike. kept: the "
    "rate asked lies in or above its exact 95 % interval; draws_kept: in how many other splits of "
    "the same motion. refused: the calibration motion cannot guarantee the rate, since this "
    "detector's alarms come in crowds. Motion that is not drawn alike has no guarantee, and "
    "missed collisions are not in it.",
}


@dataclass(frozen=True)
class Plan:
    """How much motion, and what is asked of it."""

    asked: tuple[float, ...] = (1.0, 5.0)  #: false alarms per hour
    seconds: float = 60.0  #: of an episode that are judged
    calibration: int = 360  #: episodes
    fresh: int = 600  #: episodes
    draws: int = 20  #: splits of the pool
    confidence: float = 0.95


QUICK = Plan(asked=(120.0, 300.0), seconds=20.0, calibration=14, fresh=12)


def episodes(seed: int, count: int, seconds: float, arm: Mismatch) -> Iterator[Episode]:
    """Episodes drawn alike: 10-60 % of the speed, up to 4.5 kg or nothing, 25-45 degC."""
    from tauguard.envs import Episode

    for child in np.random.SeedSequence([seed, 6]).spawn(count):
        rng = np.random.default_rng(child)
        yield Episode(
            seed=int(rng.integers(2**62)),
            seconds=seconds,
            speed=float(rng.uniform(10, 60)),
            payload_g=float(rng.uniform(0, 4500)) if rng.random() < 0.75 else 0.0,
            mismatch=arm,
            temperature=float(rng.uniform(25, 45)),
        )


def levels_of(job: tuple[Sequence[FittedDetector], Episode]) -> list[FreeScores]:
    """The levels of every detector on one episode; its trace is not kept."""
    from tauguard.detectors import CollisionAlarm, FreeScores
    from tauguard.envs import simulate

    detectors, episode = job
    trace = simulate(episode)
    return [FreeScores.of(CollisionAlarm(d, float("inf")), trace) for d in detectors]


def guarantee_rows(
    detectors: Sequence[FittedDetector],
    arm: Mismatch,
    plan: Plan,
    seed: int,
    workers: int | None = 1,
) -> list[Row]:
    """A row per detector and rate asked for.

    Args:
        detectors: fitted, on other motion of the same arm.
        arm: the simulated one.
        plan: how much.
        seed: of the episodes and the splits; not one of training's.
        workers: processes; the rows do not depend on them (``None``: one a processor).
    """
    from tqdm import tqdm

    from studies.framework import Workers

    total = plan.calibration + plan.fresh
    settle = max(detector.settle for detector in detectors)
    planned = list(episodes(seed, total, plan.seconds + settle, arm))
    with Workers(workers) as each:
        jobs = [(detectors, episode) for episode in planned]
        found = tqdm(each(levels_of, jobs), total=total, desc="episodes", disable=None, leave=False)
        by_episode = list(found)
    return [
        _row(detector.name, [levels[k] for levels in by_episode], asked, plan, seed)
        for k, detector in enumerate(detectors)
        for asked in plan.asked
    ]


def _row(name: str, levels: Sequence[FreeScores], asked: float, plan: Plan, seed: int) -> Row:
    from tauguard.detectors import poisson_rate
    from tauguard.detectors.thresholds.guarantee import guaranteed_threshold

    rng = np.random.default_rng([seed, 8])
    outcomes = []
    hours = sum(episode.seconds for episode in levels[: plan.calibration]) / 3600
    row: Row = {"study": "conformal", "detector": name, "asked_per_hour": asked}
    row |= {"calibration_hours": hours}
    for draw in range(1 + plan.draws):
        order = np.arange(len(levels)) if draw == 0 else rng.permutation(len(levels))
        picked = [levels[i] for i in order]
        try:
            guarantee = guaranteed_threshold(picked[: plan.calibration], asked, plan.confidence)
        except ValueError as refusal:
            if draw == 0:
                return {**row, "refused": str(refusal)}
            continue
        fresh = picked[plan.calibration :]
        alarms = sum(episode.alarms(guarantee.threshold) for episode in fresh)
        counted = poisson_rate(alarms, sum(episode.seconds for episode in fresh) / 3600)
        outcomes.append((guarantee, counted, bool(counted["low"] <= asked)))
    guarantee, counted, kept = outcomes[0]
    rates = [c["value"] for _, c, _ in outcomes[1:]]
    return {
        **row,
        "alarms_an_episode": guarantee.alarms_an_episode,
        "allowed": guarantee.allowed,
        "score_threshold": guarantee.threshold,
        "fresh_hours": counted["hours"],
        "false_alarms_per_hour": counted,
        "kept": kept,
        "draws": len(rates),
        "draws_kept": sum(k for *_, k in outcomes[1:]),
        "draws_at_or_below": sum(r <= asked for r in rates),
        "draws_mean_per_hour": float(np.mean(rates)) if rates else None,
    }


def trained(names: Sequence[str], arm: Mismatch, seed: int, *, quick: bool) -> list[FittedDetector]:
    """Detectors by name, fitted on simulated motion of ``arm`` with and without collisions."""
    from tauguard.datasets.plans import TRAINING_PAYLOADS, free_episodes, struck_episodes
    from tauguard.detectors import ArmModel, RobotNumbers, make_detector
    from tauguard.envs import simulate
    from tauguard.models import cura6, cura6_drive, pin_model

    speeds = (10.0, 30.0, 60.0, 20.0, 45.0)
    struck, free, seconds = (4, 8, 20.0) if quick else (15, 20, 40.0)
    planned = struck_episodes(seed, struck, 5, speeds, TRAINING_PAYLOADS[:: 15 // struck], arm)
    planned += free_episodes(seed, free, seconds, speeds, TRAINING_PAYLOADS[::2], arm)
    traces = [simulate(episode) for episode in planned]
    nominal = RobotNumbers.from_pin(pin_model(cura6.arm_xml()))
    believed = ArmModel(nominal, np.array(cura6_drive().gain))
    return [make_detector(name).fit(traces, believed) for name in names]


def measure(quick: bool, seed: int) -> list[Row]:
    """Train, calibrate and count: 6 + 10 hours of motion, 6 minutes and less when quick."""
    from tauguard.models import Mismatch

    arm = Mismatch(seed=seed)
    names = ("moving-thresholds", "residual-thresholds") if quick else NAMES
    detectors = trained(names, arm, 40 + 4 * seed, quick=quick)
    return guarantee_rows(detectors, arm, QUICK if quick else Plan(), 41 + 4 * seed, None)


def draw(rows: list[Row], figure: Figure) -> None:
    """Rate counted on fresh motion, with its interval, against the rate asked for."""
    axes = figure.add_subplot()
    rows = [row for row in rows if "refused" not in row]
    names = list(dict.fromkeys(row["detector"] for row in rows))
    asked = sorted({row["asked_per_hour"] for row in rows})
    for k, name in enumerate(names):
        own = [row for row in rows if row["detector"] == name]
        at = [asked.index(row["asked_per_hour"]) + 0.15 * (k - (len(names) - 1) / 2) for row in own]
        counted = (row["false_alarms_per_hour"] for row in own)
        errorbars(axes, at, counted, fmt="o", capsize=3, label=name)
    for k, rate in enumerate(asked):
        axes.hlines(rate, k - 0.4, k + 0.4, colors="black", linestyles="dashed")
    axes.set_xticks(range(len(asked)), [f"{rate:g} asked" for rate in asked])
    axes.set_ylabel("false alarms per hour, counted on fresh motion")
    axes.set_title("The guarantee of conformal calibration (dashed: what was asked for)")
    axes.legend()
