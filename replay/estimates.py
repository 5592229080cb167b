"""Arrows for forces, and for the contact that is estimated after each alarm."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tauguard.arrays import Array

if TYPE_CHECKING:
    from tauguard.detectors import Diagnosis

#: An estimate is shown from its alarm on for at least this time [s].
SHOWN = 0.5
#: Length of a force's arrow [m/N], so that 100 N are 0.2 m, and the largest length [m].
ARROW, LONGEST_ARROW = 2e-3, 0.5


def during(explained: Sequence[Diagnosis], frames: Array) -> list[Diagnosis | None]:
    """The estimated contact at each frame time [s], or None.

    If several contacts overlap in time, the latest is taken. A payload change is not a contact.
    """
    found: list[Diagnosis | None] = [None] * len(frames)
    for one in sorted(explained, key=lambda e: e.alarm.start):
        if one.kind == "payload":
            continue
        end = max(one.alarm.end, one.alarm.start + SHOWN)
        for frame in np.flatnonzero((frames >= one.alarm.start) & (frames <= end)):
            found[frame] = one
    return found


def arrow(force: Array) -> Array:
    """Vectors [m] that show forces [N], shape (..., 3)."""
    size = np.maximum(np.linalg.norm(force, axis=-1, keepdims=True), 1e-12)
    return np.asarray(force / size * np.minimum(ARROW * size, LONGEST_ARROW))


def arrows(shown: Sequence[Diagnosis | None]) -> dict[str, Any]:
    """Arrows that end at the points: vectors, origins, labels, and the number at each frame.

    Args:
        shown: at most one for each frame.
    """
    some = [one for one in shown if one is not None]
    vectors = arrow(np.array([one.force for one in some]).reshape(-1, 3))
    points = np.array([one.point for one in some]).reshape(-1, 3)
    return {
        "vectors": vectors,
        "origins": points - vectors,
        "labels": [f"{one.kind}, estimated" for one in some],  # the page has the summary
        "lengths": np.array([one is not None for one in shown], dtype=int),
    }
