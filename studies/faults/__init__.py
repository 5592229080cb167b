"""Faults of samples, and logs played in real time."""

from studies.framework import Part, Study

STUDY = Study(
    "faults of a robot's samples: which are reported, how soon, and at what cost",
    {
        "samples": Part(
            "faults.samples",
            "faults of samples: which are seen, how soon, false alarms, and those not reported",
        ),
        "listen": Part(
            "faults.listen",
            "a log played by RTDE in real time and heard: losses, alarms, latency",
            alias="listen",
        ),
    },
)
