"""Check that a task scores arrays of copies as it scores one copy."""

from __future__ import annotations

from typing import Any

import numpy as np

from tauguard.envs.gym.task import Outcome, Task
from tauguard.findings import ArgumentError

#: What works in place of Python's branches.
INSTEAD = "use np.where, np.minimum, & and | in place of if, min, and, or"


def check_vectorised(task: Task, rows: int) -> None:
    """Score ``rows`` drawn results as arrays, and one by one, and compare.

    Raises:
        ArgumentError: the results differ, or arrays cannot be scored.
    """
    where, rng = f"task {type(task).__name__}: score", np.random.default_rng(0)
    fields = len(task.step_type._fields)
    # Every magnitude from 1e-3 to 1e3, and zeros, so that thresholds are met on both sides.
    drawn = 10 ** rng.uniform(-3, 3, (fields, rows)) * (rng.random((fields, rows)) < 0.7)
    memory = rng.uniform(0, 1, rows)
    try:
        whole = _columns(task.score(task.step_type._make(drawn.copy()), memory.copy()), rows)
    except (ValueError, TypeError) as error:
        raise ArgumentError(
            f"{where}: arrays of several copies raise {type(error).__name__}: {error}; {INSTEAD}"
        ) from error
    for i in range(rows):
        step = task.step_type._make(drawn[:, i].tolist())
        one = _columns(task.score(step, float(memory[i])), 1)
        for name, values in one.items():
            if not np.array_equal(whole[name][i], values[0], equal_nan=True):
                raise ArgumentError(
                    f"{where}: {name} of arrays differs from that of one copy; {INSTEAD}"
                )


def _columns(outcome: Outcome, rows: int) -> dict[str, Any]:
    """The parts of an outcome, one entry per copy."""
    parts = {f"rewards[{name!r}]": term for name, term in outcome.rewards.items()}
    parts |= {name: getattr(outcome, name) for name in ("success", "memory", "terminated")}
    return {name: np.broadcast_to(np.asarray(part, float), rows) for name, part in parts.items()}
