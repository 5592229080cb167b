"""Collision detection from proprioception, on simulated arms."""

import math
from collections.abc import Iterator, Sequence

from studies.framework import Part, Point, Study, number, table_rows
from studies.framework.headlines import HOURS, Found
from tauguard.report import Row, cell

STUDY = Study(
    "collisions found by detectors, delays and rates of false alarms",
    {
        "experiment": Part(
            "detection.experiment",
            "simulated arms at six speeds: all detectors, operating points, false alarms",
            ("detector", "keep"),
        ),
        "false_alarms": Part(
            "detection.rates",
            "requested and counted rates of false alarms on six fresh arms, also guaranteed rates",
            ("keep",),
            alias="false_alarms",
        ),
        "robots": Part(
            "detection.robots",
            "any robot (--robot): collisions found, delays and false alarms",
            ("robot", "keep"),
        ),
        "sampling": Part(
            "detection.sampling",
            "sample rates from 23.8 Hz on: collisions found, delays and false alarms",
            ("keep",),
        ),
        "online": Part(
            "detection.online",
            "time per sample of observer and SVR, also with fewer support vectors",
            alias="detection_online",
        ),
        "diagnosis": Part(
            "detection.diagnosis",
            "diagnosis of alarms: errors of link, force, point and kind of event",
            alias="diagnosis",
        ),
    },
)


def points(rows: Sequence[Row]) -> Iterator[Point]:
    """Time and error of a simulated millisecond, of the SVR's kernel sum, and of all detectors."""
    for row in table_rows(rows, "real time"):
        question = "1 ms of arm, drives, observer and detector"
        error = f"score within {row['difference_to_online']:.0e} of the offline one"
        yield Point(question, "tauguard", row["total_us"], math.nan, error, "ours")
        bare, its = "mujoco.rollout of the bare arm alone", number(row["peer_us"]) or 0.0
        yield Point(question, bare, its, math.nan, "same motion")
    for row in table_rows(rows, "kernel")[:1]:
        question = f"the SVR's output, {row['support_vectors']} support vectors"
        error = f"output within {row['difference_to_sklearn']:.0e}"
        yield Point(question, "tauguard", number(row["us"]) or 0.0, math.nan, error, "ours")
        its = number(row["sklearn_us"]) or 0.0
        yield Point(question, "scikit-learn's predict", its, math.nan, "the reference", "peer")
    for row in table_rows(rows, "kernel"):
        axes = ("microseconds per sample", "rms error of the output")
        label, cost_us = f"{row['support_vectors']} support vectors", number(row["us"]) or 0.0
        yield Point("Reduced sets of the SVR", label, cost_us, row["error_rms"], "", "", *axes)
    counted = table_rows(rows, "false alarms")
    for row in (row for row in counted if row["found"]["hours"] >= HOURS):
        axes = ("requested rate [1/h]", "counted rate [1/h]")
        label = f"{row['detector']}, {row['threshold']}"
        question = "Rates of false alarms on arms that were not used for settings"
        yield Point(question, label, row["asked"], row["found"]["value"], "", "", *axes)
    cost = {row["detector"]: number(row["us"]) for row in table_rows(rows, "step")}
    for row in table_rows(rows, "hourly"):
        us, found = cost.get(row["detector"]), number(row["sensitivity"])
        if row["speed"] == 0 and us is not None and found is not None:
            question = "Detectors online, thresholds for 0.25 false alarms per hour"
            axes = ("microseconds per sample", "fraction missed from 16 N m up")
            yield Point(question, row["detector"], us, 1 - found, "", "", *axes)


def found(rows: Sequence[Row]) -> Iterator[Found]:
    """Results of all detectors at a requested rate of false alarms, tauguard's own first."""
    for row in (row for row in table_rows(rows, "hourly") if row["speed"] == 0):
        rate = row["false_alarms_per_hour"]
        yield Found(row["detector"], row["sensitivity"], rate, row["hours"], asked=0.25)


def detections(rows: Sequence[Row]) -> Iterator[Row]:
    """Rows of all detectors at a requested rate of false alarms, all speeds together."""
    for row in (row for row in table_rows(rows, "hourly") if row["speed"] == 0):
        delay, found = row["delay_ms"], row["sensitivity"]
        yield {
            "tried on": "simulated arms",
            "detector": row["detector"],
            "found from 16 N m up": f"{round((found['value'] or 0) * found['n'])} of {found['n']} "
            f"({cell(found)})",
            "false alarms an hour": cell(row["false_alarms_per_hour"])
            if row["hours"] >= HOURS
            else f"{60 * row['hours']:.0f} min are too short to tell",
            "median delay": "-" if delay["median"] is None else f"{delay['median']:.0f} ms",
            "95 % within": "-" if delay["p95"] is None else f"{delay['p95']:.0f} ms",
        }
