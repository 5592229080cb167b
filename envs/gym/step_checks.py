"""Contact checkers in the loop of an environment; each one checks every physics step."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.contacts import Checker, State, checker, registered
from tauguard.contacts.checker import reported
from tauguard.envs.gym.compiled import CompiledScene
from tauguard.findings import ArgumentError


class StepChecks:
    """The checkers of one copy of a compiled scene.

    Attributes:
        counts: how many pairs of geoms or flexes each checker reported during the last action,
            shape (checkers,).
    """

    def __init__(self, compiled: CompiledScene, names: Sequence[str]) -> None:
        """Make the checkers.

        Raises:
            ArgumentError: a name that is not registered, or a geom that a checker cannot handle.
        """
        for name in names:
            if name not in registered():
                raise ArgumentError(
                    f"checkers {name!r}: expected some of {', '.join(registered())}"
                )
        self._model = compiled.scene.model
        self._scratch = mujoco.MjData(self._model)
        self._checkers: list[Checker] = [checker(name, self._model) for name in names]
        self._pairs: list[set[tuple[int, ...]]] = [set() for _ in names]
        self._before: State | None = None

    @property
    def counts(self) -> NDArray[np.int64]:
        """Number of pairs per checker; see the class."""
        return np.array([len(found) for found in self._pairs], dtype=np.int64)

    def begin(self, data: mujoco.MjData) -> None:
        """Begin an action at the state in ``data``."""
        for found in self._pairs:
            found.clear()
        self._before = State.of(self._model, data, self._scratch)

    def see(self, data: mujoco.MjData) -> None:
        """Check the physics step that led to the state in ``data``."""
        assert self._before is not None
        after = State.of(self._model, data, self._scratch)
        for one, found in zip(self._checkers, self._pairs, strict=True):
            contacts = reported(one, self._before, after)
            if not len(contacts):
                continue
            rows = np.concatenate([contacts.geom, contacts.flex], axis=1)
            found.update(map(tuple, rows.tolist()))
        self._before = after
