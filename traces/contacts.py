"""Contacts reported by contact checkers during a run, as a part of a trace."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.findings import ArgumentError


@dataclass(frozen=True)
class CheckedContacts:
    """The contacts that one checker reported, one per row, in order of time.

    They are geometry without forces; the forces on the arm are in :class:`tauguard.traces.Truth`.
    """

    checker: str  #: the checker's name
    partners: tuple[str, ...]  #: names of bodies and flexes
    t: Array  #: times, not decreasing [s], shape (K,)
    pair: NDArray[np.int64]  #: both partners, rows of ``partners``, shape (K, 2)
    point: Array  #: contact point, world frame [m], NaN if unknown, shape (K, 3)
    normal: Array  #: unit vector from the first partner to the second, shape (K, 3)
    distance: Array  #: signed distance of the surfaces, negative in penetration [m], shape (K,)

    def __post_init__(self) -> None:
        """Check shapes, order and indices; an ``ArgumentError`` names the field with the error."""
        rows = len(self.t)
        for name, tail in (("t", ()), ("pair", (2,)), ("point", (3,)), ("normal", (3,))):
            shape = getattr(self, name).shape
            if shape != (rows, *tail):
                raise ArgumentError(f"{name}: shape {shape}, expected {(rows, *tail)}")
        if self.distance.shape != (rows,):
            raise ArgumentError(f"distance: shape {self.distance.shape}, expected {(rows,)}")
        if (np.diff(self.t) < 0).any():
            raise ArgumentError(f"t: decreasing at row {int(np.argmax(np.diff(self.t) < 0)) + 1}")
        bad = (self.pair < 0) | (self.pair >= len(self.partners))
        if bad.any():
            row = int(np.argmax(bad.any(axis=1)))
            raise ArgumentError(
                f"pair: row {row} is {self.pair[row].tolist()}, but there are "
                f"{len(self.partners)} partners"
            )

    def __len__(self) -> int:
        return len(self.t)

    def between(self, start: float, stop: float) -> CheckedContacts:
        """The contacts with ``start`` <= t < ``stop`` [s]."""
        rows = slice(*np.searchsorted(self.t, [start, stop]).tolist())
        return CheckedContacts(
            self.checker,
            self.partners,
            self.t[rows],
            self.pair[rows],
            self.point[rows],
            self.normal[rows],
            self.distance[rows],
        )
