"""Datasets: generation and detectors trained from their files."""

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
    """False alarms against missed collisions, by detector and split."""
    axes = ("false alarms an hour (none: 0.1)", "fraction missed from 16 N m up")
    for row in table_rows(rows, "entries"):
        question = f"Detectors trained from files, split {row['split']}"
        alarms, missed = max(row["false_per_hour"]["value"], 0.1), 1 - row["from_16"]["value"]
        yield Point(question, row["detector"], alarms, missed, "", "", *axes)
