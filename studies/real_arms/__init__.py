"""Logs of real arms: pushes found, delays and false alarms, beside public observers."""

from collections.abc import Iterator, Sequence

from studies.framework import Part, Study, table_rows
from tauguard.report import Row, cell

STUDY = Study(
    "logs of real arms: pushes found, delays and false alarms; published observers",
    {
        "pushes": Part(
            "real_arms.pushes",
            "pushes found, delays and false alarms of detectors and of published observers",
            alias="real_arm",
        ),
        "force": Part(
            "real_arms.force",
            "errors of force, impulse and time of pushes against a force sensor, on arm and twin",
        ),
    },
)


def detections(rows: Sequence[Row]) -> Iterator[Row]:
    """Pushes found on each arm, with the false alarms in its collision-free minutes."""
    quiet = {(row["arm"], row["detector"]): row for row in table_rows(rows, "false alarms")}
    for row in table_rows(rows, "pushes"):
        found, delay = row["found"], row["median delay ms"]
        alarms = quiet.get((row["arm"], row["detector"]))
        yield {
            "tried on": f"{row['arm']}, {row['state']}",
            "detector": row["detector"],
            "found": f"{round(found['value'] * found['n'])} of {found['n']} ({cell(found)})",
            "found by chance": row["by chance"],
            "median delay": "-" if delay is None else f"{delay:.0f} ms",
            "false alarms": "-"
            if alarms is None
            else "{alarms} in {minutes:.1f} min".format(**alarms),
        }
