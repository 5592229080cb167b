"""What was said after the alarms, for a viewer: an arrow for each contact believed in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from tauguard.arrays import Array
from tauguard.traces.trace import Alarm

#: An estimate is shown from its alarm on for at least so long [s].
SHOWN = 0.5


class Explained(Protocol):
    """What one alarm was; ``tauguard.detectors.Diagnosis`` is one."""

    @property
    def alarm(self) -> Alarm:
        """When."""

    @property
    def kind(self) -> str:
        """A word; "payload" is no contact."""

    @property
    def summary(self) -> str:
        """All of it in a few words."""

    @property
    def force(self) -> Array:
        """On the arm, world frame [N], shape (3,)."""

    @property
    def point(self) -> Array:
        """World frame [m], shape (3,)."""


def during(explained: Sequence[Explained], frames: Array) -> list[Explained | None]:
    """The contact believed in at each frame time [s], the latest where several are; None for none.

    A payload change is no contact.
    """
    found: list[Explained | None] = [None] * len(frames)
    for one in sorted(explained, key=lambda e: e.alarm.start):
        if one.kind == "payload":
            continue
        end = max(one.alarm.end, one.alarm.start + SHOWN)
        for frame in np.flatnonzero((frames >= one.alarm.start) & (frames <= end)):
            found[frame] = one
    return found


def arrows(shown: Sequence[Explained | None], metres: float, longest: float) -> dict[str, Any]:
    """Vectors and origins of arrows that end at the points, labels, and their number at each frame.

    Args:
        shown: one or none a frame.
        metres: length of one newton [m/N].
        longest: no arrow is longer [m].
    """
    some = [one for one in shown if one is not None]
    force = np.array([one.force for one in some]).reshape(-1, 3)
    size = np.maximum(np.linalg.norm(force, axis=1, keepdims=True), 1e-12)
    vectors = force / size * np.minimum(metres * size, longest)
    points = np.array([one.point for one in some]).reshape(-1, 3)
    return {
        "vectors": vectors,
        "origins": points - vectors,
        "labels": [f"{one.kind}, estimated" for one in some],  # the page has the summary
        "lengths": np.array([one is not None for one in shown], dtype=int),
    }
