"""The leaderboard of the fixed dataset tauguard-collisions-v2: every detector of the registry.

Each detector is trained on the first split of one arm, with a threshold for 10 false alarms an
hour. It is judged on the test splits, as by ``tauguard train --traces`` and ``tauguard evaluate
--data``. Detectors are ranked by their sensitivity from 16 N m up on the split ``test`` over all
arms. The table also has their false alarms.
"""

import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from studies.framework import Workers, draw_found, groups
from tauguard.datasets.configuration import Configuration, load_configuration
from tauguard.datasets.generation import generate_dataset
from tauguard.datasets.reader import arms_of, episodes_of_splits
from tauguard.datasets.recordings import labelled
from tauguard.detectors import DETECTORS, Matching, detection_metrics, make_detector
from tauguard.detectors.alarms.training import train
from tauguard.detectors.calibration.nominal import nominal_arm
from tauguard.detectors.evaluation.matching import matchings
from tauguard.report import Row

NAME = "tauguard-collisions-v2"  #: name of the dataset
PER_HOUR = 10.0  #: requested false alarms per hour
QUICK = ("residual-thresholds",)  #: detector of a quick run
QUICK_EPISODES = {"train": 6, "test": 2}  #: number of episodes per split of a quick run
QUICK_SECONDS = 30.0  #: length of an episode of a quick run [s]

NOTES = {
    "entries": "one detector per arm, trained on the train split for 10 false alarms per hour; "
    "rates over all arms of a split. from_16: fraction found of the collisions from 16 N m up, "
    "and their delays [ms]. train_s: training time for one arm [s].",
}


@dataclass(frozen=True)
class Entry:
    """One detector, trained for one arm and judged on its splits."""

    detector: str
    arm: str
    seconds: float  #: training time [s]
    splits: tuple[tuple[str, tuple[Matching, ...]], ...]


def measure(
    quick: bool, seed: int, keep: str | None = None, detector: str | None = None
) -> list[Row]:
    """Return a row for each detector and split.

    Args:
        quick: one detector on a few episodes of one arm.
        seed: of the dataset; 0 is the dataset that is published.
        keep: folder of the dataset; it is made, or completed, there (default: a temporary one).
        detector: the user's own detector as module:Class, besides those of the registry.
    """
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "dataset" if keep is None else Path(keep)
        generate_dataset(configuration(quick, seed), folder)
        arms = arms_of(folder, ("train",))
        names = (*(QUICK if quick else tuple(DETECTORS)), *filter(None, [detector]))
        with Workers() as each:
            jobs = [(folder, arm, name) for arm in arms for name in names]
            entries = list(each(_entry, jobs))
    return [row for name in names for row in rows_of(name, entries)]


def draw(rows: list[Row], figure: Any) -> None:
    """Fraction of the collisions from 16 N m up that is found, by split and detector."""
    splits = groups(rows, lambda row: f"split {row['split']}")
    draw_found({k: {r["detector"]: r["from_16"] for r in own} for k, own in splits.items()}, figure)


def configuration(quick: bool, seed: int) -> Configuration:
    """The quick configuration of the dataset (two hours), with another seed unless it is 0."""
    whole = load_configuration(NAME).quick()
    whole = replace(whole, seed=seed) if seed else whole
    if not quick:
        return whole
    fewer: dict[str, Any] = {"arms": ("cura6",), "seconds": QUICK_SECONDS, "collisions": 8}
    splits = (split for split in whole.splits if split.name in QUICK_EPISODES)
    return replace(
        whole,
        splits=tuple(replace(s, episodes=QUICK_EPISODES[s.name], **fewer) for s in splits),
    )


def _entry(job: tuple[Path, str, str]) -> Entry:
    folder, arm, name = job
    recordings = labelled(folder, arm)
    begin = time.process_time()
    alarm = train(make_detector(name), recordings, nominal_arm(recordings), PER_HOUR)
    seconds = time.process_time() - begin
    splits = tuple(
        (split, tuple(matchings(alarm, traces)))
        for split, traces in episodes_of_splits(folder, alarm.detector.arm.robot, ())
    )
    return Entry(name, arm, seconds, splits)


def rows_of(name: str, entries: Sequence[Entry]) -> list[Row]:
    """The rows of a detector, one for each split."""
    own = [entry for entry in entries if entry.detector == name]
    found: dict[str, list[Matching]] = {}
    for split, one in (pair for entry in own for pair in entry.splits):
        found.setdefault(split, []).extend(one)
    rows: list[Row] = []
    for split, matched in found.items():
        metrics = detection_metrics(matched)
        head = metrics["headline"]
        rows.append(
            {
                "study": "entries",
                "detector": name,
                "split": split,
                "from_16": head["sensitivity"],
                "all": metrics["sensitivity"],
                "median": head["delay_ms"]["median"],
                "p95": head["delay_ms"]["p95"],
                "false_per_hour": metrics["false_alarms_per_hour"],
                "train_s": float(np.median([entry.seconds for entry in own])),
            }
        )
    return rows
