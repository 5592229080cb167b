"""What acts beside the policy, or judges it, in every copy: reactions, monitors, budgets."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tauguard.envs.gym.batch import Batch


class Rule:
    """A rule in the loop of an environment; wrappers add one to a single or a vector environment.

    Attributes:
        columns: values by their name in ``info``, one row per copy.
        over: the copies whose episode ends, shape (rows,).
        memory: what the rule remembers of each copy; snapshots contain it.
    """

    def __init__(self, batch: Batch) -> None:
        """Keep the batch."""
        self.batch = batch
        self.columns: dict[str, NDArray[Any]] = {}
        self.over = np.zeros(batch.rows, dtype=np.bool_)
        self.memory: list[Any] = [None] * batch.rows

    def begin(self, i: int) -> None:
        """Begin an episode of copy ``i``, whose start is in the batch."""
        raise NotImplementedError

    def act(self, i: int) -> None:
        """Before an action of copy ``i``."""

    def look(self, i: int) -> None:
        """After an action of copy ``i``."""
        raise NotImplementedError


class Rules:
    """The rules of an environment, in the order of their wrappers."""

    def __init__(self, batch: Batch) -> None:
        """Begin without rules."""
        self._batch, self._all = batch, list[Rule]()
        #: Classes and settings, with which a copied environment makes its rules again.
        self.made: list[tuple[type[Rule], dict[str, Any]]] = []

    def __bool__(self) -> bool:
        """Whether there are rules."""
        return bool(self._all)

    def add(self, kind: type[Any], **settings: Any) -> None:
        """Add a rule.

        Raises:
            ArgumentError: a setting that is out of range, or that the environment cannot have.
        """
        self._all.append(kind(self._batch, **settings))
        self.made.append((kind, settings))

    def begin(self, i: int) -> None:
        """Begin an episode of copy ``i``."""
        for rule in self._all:
            rule.over[i] = False
            rule.begin(i)

    def act(self, i: int) -> None:
        """Before an action of copy ``i``."""
        for rule in self._all:
            rule.act(i)

    def look(self, i: int) -> None:
        """After an action of copy ``i``."""
        for rule in self._all:
            rule.look(i)

    def over(self) -> NDArray[np.bool_]:
        """The copies whose episodes end, shape (rows,)."""
        over = np.zeros(self._batch.rows, dtype=np.bool_)
        for rule in self._all:
            over |= rule.over
        return over

    def columns(self) -> dict[str, NDArray[Any]]:
        """Copies of the values in ``info``, one row per copy."""
        return {name: values.copy() for rule in self._all for name, values in rule.columns.items()}

    def get_state(self, i: int) -> list[Any]:
        """What the rules remember of copy ``i``."""
        return [
            copy.deepcopy(
                (rule.memory[i], rule.over[i], {k: v[i] for k, v in rule.columns.items()})
            )
            for rule in self._all
        ]

    def set_state(self, i: int, state: list[Any]) -> None:
        """Restore what :meth:`get_state` returned."""
        for rule, (memory, over, columns) in zip(self._all, copy.deepcopy(state), strict=True):
            rule.memory[i], rule.over[i] = memory, over
            for name, value in columns.items():
                rule.columns[name][i] = value
