"""Datasets: generation and detectors trained from their files."""

from studies.framework import Part, Study

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
