"""The fixed dataset tauguard-collisions-v1: what every detector of the registry reaches on it.

Each detector is trained on the first split of one arm, with a threshold for 10 false alarms an hour
(the default of ``tauguard train``), and judged on the splits of the test, as ``tauguard train
--traces`` and ``tauguard evaluate --data`` do it. The figure of a detector is its sensitivity from
16 N m up on the split ``test`` over all arms, beside its false alarms.
"""

from __future__ import annotations

import itertools
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.framework import Workers
from tauguard.datasets.configuration import Configuration, load
from tauguard.datasets.generation import generate_dataset
from tauguard.datasets.reader import arms_of, episodes_of_splits
from tauguard.datasets.recordings import labelled
from tauguard.datasets.schedule import all_planned
from tauguard.datasets.shard import simulated
from tauguard.detectors import (
    DETECTORS,
    CollisionAlarm,
    Matching,
    detection_metrics,
    make_detector,
    matchings,
    train,
)
from tauguard.detectors.calibration.nominal import nominal_arm
from tauguard.report import Row
from tauguard.traces import Trace

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: The dataset, and the rate that thresholds aim at.
NAME, PER_HOUR = "tauguard-collisions-v1", 10.0
#: The detector of the quick run, and episodes of each split there, each so long [s].
QUICK, QUICK_EPISODES, QUICK_SECONDS = ("residual-thresholds",), {"train": 6, "test": 2}, 30.0

#: What the columns mean.
NOTES = {
    "entries": "Trained on the train split of each of its arms, 10 false alarms an hour aimed at; "
    "all arms of a split together. from_16: share found of the collisions from 16 N m up, with its "
    "95 % interval; delays [ms] are of those. train_s: of one arm.",
    "by path": "One arm: a detector trained and judged by the dataset's path, and from the traces "
    "as simulated, before they are rounded and stored.",
}


@dataclass(frozen=True)
class Entry:
    """One detector, trained for one arm and judged on its splits."""

    detector: str
    arm: str
    seconds: float  #: of training
    splits: tuple[tuple[str, tuple[Matching, ...]], ...]


def measure(quick: bool, seed: int, keep: str | None = None) -> list[Row]:
    """Rows ``entries``, a detector and split each, and two rows ``by path``.

    Args:
        quick: one detector on a few episodes of one arm.
        seed: of the dataset; 0 is the dataset that is published.
        keep: folder of the dataset; it is made, or completed, there (default: a temporary one).
    """
    wanted = configuration(quick, seed)
    with _folder(keep) as folder:
        generate_dataset(wanted, folder)
        arms = arms_of(folder, ("train",))
        names = QUICK if quick else tuple(DETECTORS)
        with Workers() as each:
            jobs = [(folder, arm, name) for arm, name in itertools.product(arms, names)]
            entries = list(each(_entry, jobs))
        rows = [row for name in names for row in rows_of(name, entries)]
        return rows + by_path(wanted, folder, arms[0], names[0])


def configuration(quick: bool, seed: int) -> Configuration:
    """Two hours of the dataset; another seed draws another one of the same kind."""
    whole = load(NAME).quick()
    if seed:
        whole = replace(whole, seed=seed)
    if not quick:
        return whole
    splits = tuple(
        replace(
            split,
            episodes=QUICK_EPISODES[split.name],
            arms=("cura6",),
            seconds=QUICK_SECONDS,
            collisions=8,
        )
        for split in whole.splits
        if split.name in QUICK_EPISODES
    )
    return replace(whole, splits=splits)


@contextmanager
def _folder(keep: str | None) -> Iterator[Path]:
    if keep is not None:
        yield Path(keep)
        return
    with tempfile.TemporaryDirectory() as place:
        yield Path(place) / "dataset"


def _entry(job: tuple[Path, str, str]) -> Entry:
    folder, arm, name = job
    recordings = labelled(folder, arm)
    begin = time.process_time()
    alarm = trained(recordings, name)
    seconds = time.process_time() - begin
    splits = tuple(
        (split, tuple(matchings(alarm, traces)))
        for split, traces in episodes_of_splits(folder, alarm.detector.arm.robot, ())
    )
    return Entry(name, arm, seconds, splits)


def trained(recordings: Sequence[Trace], name: str) -> CollisionAlarm:
    """A method of the registry, fitted as ``tauguard train --traces`` does."""
    return train(make_detector(name), recordings, nominal_arm(recordings), PER_HOUR)


def rows_of(name: str, entries: Sequence[Entry]) -> list[Row]:
    """A detector's rows, a split each."""
    own = [entry for entry in entries if entry.detector == name]
    found: dict[str, list[Matching]] = {}
    for entry in own:
        for split, own_split in entry.splits:
            found.setdefault(split, []).extend(own_split)
    seconds = float(np.median([entry.seconds for entry in own]))
    return [
        {"study": "entries", "detector": name, "split": split, **_columns(m), "train_s": seconds}
        for split, m in found.items()
    ]


def _columns(found: Sequence[Matching]) -> dict[str, Any]:
    one = detection_metrics(found)
    head = one["headline"]
    return {
        "from_16": head["sensitivity"],
        "all": one["sensitivity"],
        "median": head["delay_ms"]["median"],
        "p95": head["delay_ms"]["p95"],
        "false_per_hour": one["false_alarms_per_hour"],
    }


def by_path(wanted: Configuration, folder: Path, arm: str, name: str) -> list[Row]:
    """The same detector by the dataset's path and from the traces as they were simulated."""
    stored = {"arm.xml": (folder / "arms" / f"{arm}.xml").read_text()}
    episodes = [one for one in all_planned(wanted) if one.arm == arm]
    traces = {
        split: [
            replace(simulated(one, False)[0], attachments=stored)
            for one in episodes
            if one.split == split
        ]
        for split in ("train", "test")
    }
    rows = []
    for source in ("path", "traces"):
        recordings = labelled(folder, arm) if source == "path" else traces["train"]
        alarm = trained(recordings, name)
        judge: Iterator[Trace] | Sequence[Trace] = traces["test"]
        if source == "path":
            judge = dict(episodes_of_splits(folder, alarm.detector.arm.robot, ("test",)))["test"]
        columns = _columns(matchings(alarm, judge))
        rows.append({"study": "by path", "from": source, "threshold": alarm.threshold, **columns})
    return rows


def draw(rows: list[Row], figure: Figure) -> None:
    """False alarms an hour against collisions missed from 16 N m up, a point a detector."""
    own = [row for row in rows if row["study"] == "entries"]
    splits = list(dict.fromkeys(row["split"] for row in own))
    plots = np.atleast_1d(figure.subplots(1, len(splits)))
    for axes, split in zip(plots, splits, strict=True):
        for k, row in enumerate(r for r in own if r["split"] == split):
            missed, alarms = 1 - row["from_16"]["value"], row["false_per_hour"]["value"]
            axes.plot(alarms, missed, "os^Dv<>"[k % 7], label=row["detector"], alpha=0.8)
        axes.set(xlabel="false alarms per hour", ylabel="share missed from 16 N m up", title=split)
        axes.set_xscale("symlog", linthresh=1)
        axes.set_xlim(left=0)
        axes.set_ylim(bottom=0)
        axes.margins(x=0.2)
        axes.grid(alpha=0.3)
    figure.legend(*plots[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
