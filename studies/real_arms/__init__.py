"""Logs of real arms: the table of the benchmark, and forces beside a sensor."""

from collections.abc import Iterator, Sequence

from studies.framework import Part, Study, table_rows
from tauguard.report import Row

STUDY = Study(
    "logs of real arms: contacts found and false alarms of many methods; forces beside a sensor",
    {
        "table": Part(
            "real_arms.table",
            "the benchmark's table: contacts found, delays, false alarms of many methods",
            options=("detector", "alarms"),
            alias="real_arm",
        ),
        "identification": Part(
            "real_arms.identification",
            "calibration beside figaroh: torque error on held-out logs, and time",
        ),
        "force": Part(
            "real_arms.force",
            "errors of force, impulse and time of pushes against a force sensor, on arm and twin",
        ),
    },
)


def detections(rows: Sequence[Row]) -> Iterator[Row]:
    """Contacts found on each arm at about 60 false alarms an hour."""
    for row in table_rows(rows, "table"):
        if row.get("contacts") and row["operating point"] == "60 an hour":
            yield {
                "tried on": f"{row['arm']}, {row['truth']}, {row['state']}",
                "detector": row["method"],
                "found": f"{row['found']} of {row['contacts']}",
                "found by chance": row["by chance"],
                "median delay": "-",
                "false alarms": f"{row['false alarms']} in {row['free min']} min"
                if row["false alarms"]
                else "-",
            }
