"""Datasets: generation and detectors trained from their files."""

import math
from collections.abc import Iterator, Sequence

from studies.framework import Part, Point, Study, table_rows
from tauguard.report import Row

STUDY = Study(
    "generating, storing and reading datasets, and detectors trained from their files",
    {
        "generation": Part(
            "datasets.generation", "generation: rate beside mujoco.rollout, bytes, reading"
        ),
        "entries": Part(
            "datasets.entries",
            "every detector of the registry, and your own, on tauguard-collisions-v2",
            ("keep", "detector"),
            alias="entries",
        ),
    },
)


def points(rows: Sequence[Row]) -> Iterator[Point]:
    """Generation beside rollout; false alarms against missed collisions, by detector and split."""
    for row in (row for row in table_rows(rows, "rate") if "rollout / ours" in row):
        question, us = f"a sample of a data set, {row['episodes']} episodes", row["rollout [us]"]
        ours = us / row["rollout / ours"]
        yield Point(question, "tauguard", ours, math.nan, "labels, residual, written", "ours")
        yield Point(question, "mujoco.rollout of the scene", us, math.nan, "nothing kept", "peer")
    axes = ("false alarms an hour (none: 0.1)", "fraction missed from 16 N m up")
    for row in table_rows(rows, "entries"):
        question = f"Detectors trained from files, split {row['split']}"
        alarms, missed = max(row["false_per_hour"]["value"], 0.1), 1 - row["from_16"]["value"]
        yield Point(question, row["detector"], alarms, missed, "", "", *axes)
