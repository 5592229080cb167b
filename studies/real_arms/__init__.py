"""Logs of real arms: pushes found, delays and false alarms, beside public observers."""

from collections.abc import Iterator, Sequence

from studies.framework import Part, Point, Study, table_rows
from tauguard.report import Row, cell

STUDY = Study(
    "logs of real arms: pushes found, delays and false alarms, beside public observers",
    {
        "pushes": Part(
            "real_arms.pushes",
            "pushes found, delays and false alarms in logs of real arms, beside public observers",
            alias="real_arm",
        ),
        "force": Part(
            "real_arms.force",
            "force, impulse and time of pushes beside a force sensor, and a twin pushed with it",
        ),
    },
)


def detections(rows: Sequence[Row]) -> Iterator[Row]:
    """Pushes on the UR5 and the collision-free minutes of all real arms."""
    free: dict[str, list[float]] = {}
    for row in table_rows(rows, "false alarms"):
        sums = free.setdefault(row["detector"], [0.0, 0.0])
        sums[0] += row["alarms"]
        sums[1] += row["minutes"]
    for row in table_rows(rows, "pushes"):
        (alarms, minutes), found = free.get(row["detector"], (0.0, 0.0)), row["found"]
        delay = row["median delay ms"]
        yield {
            "tried on": f"{row['arm']}, {row['state']}",
            "detector": row["detector"],
            "found": f"{round(found['value'] * found['n'])} of {found['n']} ({cell(found)})",
            "found by chance": row["by chance"],
            "median delay": "-" if delay is None else f"{delay:.0f} ms",
            "false alarms on all arms": f"{alarms:.0f} in {minutes:.0f} min",
        }


def points(rows: Sequence[Row]) -> Iterator[Point]:
    """Pushes missed over the false alarms on the same arm."""
    axes = ("false alarms an hour (none: 0.1)", "fraction of pushes missed")
    rates = {(row["arm"], row["detector"]): row for row in table_rows(rows, "false alarms")}
    for row in table_rows(rows, "pushes"):
        quiet = rates.get((row["arm"], row["detector"]))
        if quiet is not None:
            question = f"Pushes on {row['arm']}, {row['state']}"
            role = "" if row["detector"] == "ours" else "peer"
            cost, missed = max(quiet["per hour"], 0.1), 1 - row["found"]["value"]
            yield Point(question, row["detector"], cost, missed, "", role, *axes)
