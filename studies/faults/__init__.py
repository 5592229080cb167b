"""Faults of samples, and logs played in real time."""

from collections.abc import Iterator, Sequence

from studies.framework import Part, Point, Study, table_rows
from tauguard.report import Row

STUDY = Study(
    "faults of a robot's samples: faults reported, delays, false alarms",
    {
        "samples": Part(
            "faults.samples",
            "injected faults: those reported and those not, delays, false alarms",
        ),
        "listen": Part(
            "faults.listen",
            "a log sent by RTDE in real time to `listen`: lost samples, alarms, latency",
            alias="listen",
        ),
    },
)


def points(rows: Sequence[Row]) -> Iterator[Point]:
    """Delay of the detection of faults, and fraction of missed faults."""
    axes = ("median delay of detected faults [ms]", "fraction of faults missed")
    for row in table_rows(rows, "faults"):
        if row["median_ms"] is not None:
            delay, missed = max(row["median_ms"], 1.0), 1 - row["seen"]["value"]
            yield Point(
                f"Faults of samples, {row['arm']}", row["fault"], delay, missed, "", "", *axes
            )
    for row in table_rows(rows, "listen"):
        axes = ("median latency [us]", "samples lost")
        label, us = f"{row['rate [Hz]']:g} Hz", row["median [us]"]
        yield Point("A log played by RTDE in real time", label, us, row["lost"], "", "", *axes)
