"""Threshold laws on one set of arms: the rate that was found, what was stated, and the price."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from studies.detection.arm_scores import Arm
from tauguard.detectors import poisson_rate
from tauguard.detectors.evaluation.metrics import HEADLINE
from tauguard.detectors.thresholds.expected_rate import ExpectedRate
from tauguard.detectors.thresholds.free_scores import FreeScores, speed_levels
from tauguard.detectors.thresholds.law import threshold_for_rate
from tauguard.detectors.thresholds.speed_levels import SpeedLevels
from tauguard.report import Row
from tauguard.report import rate as wilson

#: The score at every speed.
AS_IT_IS = SpeedLevels(np.zeros(1), np.zeros(1), np.ones(1))
#: How a threshold is chosen: the product's way, the rate expected over all draws of the episodes,
#: and a bound that is enough in 80 % of the draws.
LAWS: dict[str, Callable[[Sequence[FreeScores], ExpectedRate, float], float]] = {
    "usual tail": lambda known, _, asked: threshold_for_rate(known, asked),
    "mean over draws": lambda _, expected, asked: expected.threshold(asked),
    "80 % bound": lambda _, expected, asked: expected.threshold(asked, 0.8),
}


@dataclass(frozen=True)
class ArmOutcome:
    """What a threshold gave on one arm."""

    alarms: int
    hours: float  #: of fresh motion
    stated: tuple[float, float]  #: [1/h]
    collisions: tuple[tuple[float, float | None], ...]  #: torque [N m] and delay [s]

    @property
    def found(self) -> tuple[float, float]:
        """The exact 95 % interval of the rate [1/h]."""
        rate = poisson_rate(self.alarms, self.hours)
        return rate["low"], rate["high"]


@dataclass(frozen=True)
class Judged:
    """What a law gave on every arm."""

    detector: str
    law: str
    asked: float  #: [1/h]
    arms: tuple[ArmOutcome, ...]


def judged(
    arms: Sequence[Arm], name: str, law: str, asked: float, normalised: bool = True
) -> Judged:
    """Thresholds of one law at one rate, on all arms; of scores over the speed, or as they are."""
    of_arms = (_of_arm(arm, name, law, asked, normalised) for arm in arms)
    return Judged(name, law, asked, tuple(of_arms))


def _of_arm(arm: Arm, name: str, law: str, asked: float, normalised: bool) -> ArmOutcome:
    levels = speed_levels(arm.calibration[name]) if normalised else AS_IT_IS
    known = [one.over(levels) for one in arm.calibration[name]]
    fresh = [one.over(levels) for one in arm.fresh[name]]
    expected = ExpectedRate.of(known)
    threshold = LAWS[law](known, expected, asked)
    return ArmOutcome(
        sum(one.alarms(threshold) for one in fresh),
        sum(one.seconds for one in fresh) / 3600,
        expected.interval(threshold),
        tuple((blow.peak_tau, blow.delay(levels, threshold)) for blow in arm.struck[name]),
    )


def rate_row(case: Judged, group: str, arms: Sequence[ArmOutcome]) -> Row:
    """``arms``: the rate found on these arms."""
    low, high = np.median([arm.stated for arm in arms], axis=0)
    alarms = [arm.alarms for arm in arms]
    return {
        "study": "arms",
        "detector": case.detector,
        "law": case.law,
        "asked": case.asked,
        "arms": group,
        "found_per_hour": poisson_rate(sum(alarms), sum(a.hours for a in arms)),
        "stated_low": float(low),
        "stated_high": float(high),
        "kept": wilson(sum(a.found[0] <= case.asked for a in arms), len(arms)),
        "inside": wilson(sum(_meet(a.found, a.stated) for a in arms), len(arms)),
        "alarms_an_arm": {
            "median": float(np.median(alarms)),
            "low": min(alarms),
            "high": max(alarms),
        },
    }


def _meet(one: tuple[float, float], other: tuple[float, float]) -> bool:
    return one[0] <= other[1] and other[0] <= one[1]


def price_row(case: Judged, group: str, arms: Sequence[ArmOutcome]) -> Row | None:
    """``price``: what the thresholds find; nothing where nothing was struck."""
    all_of = [pair for arm in arms for pair in arm.collisions]
    if not all_of:
        return None
    hard = [delay for torque, delay in all_of if torque >= HEADLINE]
    known = [1e3 * delay for delay in hard if delay is not None]
    median, late = np.percentile(known, (50, 95)) if known else (np.nan, np.nan)
    return {
        "study": "price",
        "detector": case.detector,
        "law": case.law,
        "asked": case.asked,
        "arms": group,
        "sensitivity": wilson(len(known), len(hard)),
        "sensitivity_all": wilson(sum(d is not None for _, d in all_of), len(all_of)),
        "delay_ms": float(median) if known else None,
        "delay_p95_ms": float(late) if known else None,
    }
