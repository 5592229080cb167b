"""Datasets: generation and detectors trained from their files."""

from studies.framework import Part, Study

STUDY = Study(
    "generating, storing and reading datasets, and training detectors on them",
    {
        "generation": Part(
            "datasets.generation",
            "generation rate compared with mujoco.rollout, file sizes, time of reading",
        ),
        "entries": Part(
            "datasets.entries",
            "all detectors of tauguard, and your own, on tauguard-collisions-v2",
            ("keep", "detector"),
            alias="entries",
        ),
    },
)
