"""The interface of a task, and the construction of its scene."""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple

import numpy as np

from tauguard.envs.gym.batch import Batch, StepMetrics
from tauguard.envs.gym.compiled import CompiledScene, compile_scene
from tauguard.envs.gym.placing import MOVES, STEP, StartsInContact, Usual
from tauguard.envs.gym.settings import Settings
from tauguard.findings import ArgumentError, cause

#: Largest number of initial states that are drawn to find one without contact.
BEGINNINGS = 100
#: Number of seeds with which the places of tables, people and other things are tested.
ARRANGED = 12
#: For an arm that is not part of the package: how many of the tested initial states may overlap
#: something that can be moved.
DRAWN_AGAIN = 1


class Outcome(NamedTuple):
    """A task's result of one step: numbers for one copy, or arrays with one entry per copy."""

    rewards: dict[str, Any]  #: named terms, the task's :attr:`Task.terms`; the reward is their sum
    success: Any
    memory: Any  #: the memory that :meth:`Task.score` gets at the next step
    terminated: Any = False


class Task(Usual):
    """A task: where an episode starts, the reward of a step, and when the episode ends."""

    #: Keywords that differ from those of :class:`tauguard.envs.gym.settings.Settings`.
    defaults: ClassVar[dict[str, Any]] = {}
    #: Number of arms in the scene.
    arms: ClassVar[int] = 1
    #: Keywords of the task itself, with their defaults.
    options: ClassVar[dict[str, Any]] = {}
    #: Names of the terms of the reward; ``info`` has each as ``reward_NAME``.
    terms: ClassVar[tuple[str, ...]] = ()
    #: ``info["reason"]`` of an episode that the task terminates after a success.
    ended: ClassVar[str] = ""
    #: ``info["reason"]`` of an episode that the task terminates without a success.
    failed: ClassVar[str] = ""

    def __init__(self, batch: Batch, **options: Any) -> None:
        """Keep the batch."""
        self.batch = batch
        #: The number that :meth:`score` keeps from one step to the next, one per copy.
        self.memory = np.zeros(batch.rows)

    def __repr__(self) -> str:
        """The task and its batch."""
        return f"{type(self).__name__}({self.batch!r})"

    def start(self, i: int, rng: np.random.Generator) -> None:
        """Begin an episode of copy ``i``; an implementation calls :meth:`Batch.start`."""
        raise NotImplementedError

    def score(self, step: StepMetrics, memory: Any) -> Outcome:
        """Compute rewards and success of a step, for one copy or for arrays of all copies.

        Args:
            step: the result of the action.
            memory: the value that the last step, or :meth:`start`, stored.
        """
        raise NotImplementedError

    def begin(self, i: int, rng: np.random.Generator) -> None:
        """Begin an episode of copy ``i`` without an initial contact of the arm.

        Raises:
            StartsInContact: no such initial state was found.
        """
        for _ in range(BEGINNINGS):
            try:
                return self.start(i, rng)
            except StartsInContact as error:
                refused = error
        raise refused

    def after(self, i: int, rng: np.random.Generator) -> None:
        """Prepare the next goal after a success of copy ``i``; the next observation has it."""

    def get_state(self) -> Any:
        """The state of the task besides :attr:`memory`."""
        return None

    def set_state(self, state: Any) -> None:
        """Restore what :meth:`get_state` returned."""


def build(
    task_type: type[Task], keywords: dict[str, Any], rows: int
) -> tuple[CompiledScene, Batch, Task]:
    """Scene, batch and task of an environment with these keywords.

    Things whose place the environment chooses are moved until initial states are free of contact.
    """
    own = {name: keywords.pop(name, value) for name, value in task_type.options.items()}
    try:
        settings = Settings.from_keywords(task_type.defaults, keywords)
    except ArgumentError as error:
        if own and error.findings.of("keyword"):
            raise ArgumentError(cause("keyword", f"{error}, {', '.join(own)}")) from None
        raise
    default, moved = frozenset(task_type.defaults) - keywords.keys(), dict[str, float]()
    for _ in range(MOVES + 1):
        compiled = compile_scene(settings, task_type, task_type.arms, moved, default)
        batch = Batch(compiled, rows)
        task = task_type(batch, **own)
        movable = _movable(settings, default, task_type)
        overlap = _overlap(task, set() if compiled.layout.own else movable)
        if overlap is None or overlap.kind not in movable:
            break
        step = STEP * max(1.0, compiled.layout.scale)
        moved[overlap.kind] = moved.get(overlap.kind, 0.0) + step
    if overlap is not None:
        raise overlap
    return compiled, batch, task


def _overlap(task: Task, strict: set[str]) -> StartsInContact | None:
    """The first overlap that occurs too often in initial states, or None.

    The limit is :data:`DRAWN_AGAIN` for kinds in ``strict`` and :data:`BEGINNINGS` for others.
    """
    missed = 0
    for seed in range(ARRANGED):
        rng = np.random.default_rng(seed)
        for _ in range(BEGINNINGS):
            try:
                task.start(0, rng)
                break
            except StartsInContact as error:
                missed += 1
                if missed > (DRAWN_AGAIN if error.kind in strict else BEGINNINGS):
                    return error
    return None


def _movable(settings: Settings, default: frozenset[str], task_type: type[Task]) -> set[str]:
    """Kinds of things whose place the environment chooses; see ``StartsInContact.kind``."""
    kinds = set(default & {"table", "cloth"})
    kinds |= {item for item in settings.obstacles if isinstance(item, str)}
    return kinds | ({"second arm"} if task_type.arms == 2 else set())
