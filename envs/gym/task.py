"""The interface of a task, and the construction of its scene."""

from __future__ import annotations

import importlib
from collections import namedtuple
from collections.abc import Mapping
from functools import cache
from typing import Any, ClassVar, NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from tauguard.arrays import Array
from tauguard.envs.gym.actions import Entry
from tauguard.envs.gym.batch import Batch, StepMetrics
from tauguard.envs.gym.compiled import CompiledScene, compile_scene, tool_position
from tauguard.envs.gym.placing import MOVES, STEP, StartsInContact, Usual
from tauguard.envs.gym.settings import Settings
from tauguard.findings import ArgumentError

#: Largest number of initial states that are drawn to find one without contact.
BEGINNINGS = 100
#: Number of seeds with which the places of tables, people and other things are tested.
ARRANGED = 12
#: For an arm that is not part of the package: how many of the tested initial states may overlap
#: something that can be moved.
DRAWN_AGAIN = 1
#: Number of steps of the inverse kinematics from home to a place.
ROUNDS = 30


class Outcome(NamedTuple):
    """A task's result of one step: numbers for one copy, or arrays with one entry per copy."""

    rewards: dict[str, Any]  #: named terms, the task's :attr:`Task.terms`; the reward is their sum
    success: Any
    memory: Any  #: the memory that :meth:`Task.score` gets at the next step
    terminated: Any = False


class Task(Usual):
    """A task: where an episode starts, what is measured, the reward, and when the episode ends.

    A subclass implements :meth:`start` and :meth:`score`, and overrides the rest where it needs to.
    One class serves single and vector environments; :meth:`score` gets numbers or arrays.
    """

    #: Keywords that differ from those of :class:`tauguard.envs.gym.settings.Settings`.
    defaults: ClassVar[dict[str, Any]] = {}
    #: Number of arms in the scene.
    arms: ClassVar[int] = 1
    #: Keywords of the task itself, with their defaults.
    options: ClassVar[dict[str, Any]] = {}
    #: Names of the terms of the reward; ``info`` has each as ``reward_NAME``.
    terms: ClassVar[tuple[str, ...]] = ()
    #: Names of the numbers that :meth:`measure` returns; ``info`` has each.
    measures: ClassVar[tuple[str, ...]] = ()
    #: ``info["reason"]`` of an episode that the task terminates after a success.
    ended: ClassVar[str] = ""
    #: ``info["reason"]`` of an episode that the task terminates without a success.
    failed: ClassVar[str] = ""
    #: Distance at which a goal counts as reached [m].
    tolerance: float = 0.03

    def __init__(self, batch: Batch, **options: Any) -> None:
        """Keep the batch."""
        self.batch = batch
        #: What :meth:`score` gets.
        self.step_type: Any = step_type(self.measures)
        #: The number that :meth:`score` keeps from one step to the next, one per copy.
        self.memory = np.zeros(batch.rows)

    def __repr__(self) -> str:
        """The task and its batch."""
        return f"{type(self).__name__}({self.batch!r})"

    def start(self, i: int, rng: np.random.Generator) -> None:
        """Begin an episode of copy ``i``; an implementation calls :meth:`Batch.start`."""
        raise NotImplementedError

    def score(self, step: Any, memory: Any) -> Outcome:
        """Compute rewards and success of a step, for one copy or for arrays of all copies.

        Args:
            step: the result of the action: the fields of :class:`StepMetrics`, and those that the
                task measures.
            memory: the value that the last step, or :meth:`start`, stored.
        """
        raise NotImplementedError

    def joints_at(self, place: Array) -> Array:
        """Joint positions near home with the first tool at ``place`` [rad], shape (n,)."""
        compiled, model = self.batch.compiled, self.batch.compiled.scene.model
        adr, dofs = compiled.scene.qpos_adr, compiled.scene.dof_adr
        data, jac = mujoco.MjData(model), np.zeros((3, model.nv))
        data.qpos[adr] = compiled.scene.home
        for _ in range(ROUNDS):
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            tool = tool_position(compiled, data)
            mujoco.mj_jac(model, data, jac, None, tool, compiled.tools[0][1])
            part = jac[:, dofs]
            weight = np.linalg.solve(part @ part.T + 1e-4 * np.eye(3), place - tool)
            data.qpos[adr] += np.clip(part.T @ weight, -0.2, 0.2)
        return np.array(data.qpos[adr])

    @classmethod
    def entries(cls, compiled: CompiledScene) -> list[Entry]:
        """The entries that the task appends to the observation."""
        return []

    def observe(self, i: int) -> ArrayLike:
        """The values of :meth:`entries` for copy ``i``; they are clipped to the entries' ranges."""
        return ()

    def measure(self, i: int) -> Mapping[str, float]:
        """The numbers that :attr:`measures` names, at the start and after each action of a copy.

        An implementation may also act on the scene, for example with :meth:`Batch.grasp`. The last
        values are in ``batch.metrics[name][i]``.
        """
        return {}

    def achieved(self, i: int) -> Array:
        """What counts as the goal of copy ``i`` now, shape (g,); default: the tools' positions."""
        batch = self.batch
        tools = [tool_position(batch.compiled, batch.datas[i], a) for a in range(self.arms)]
        return np.concatenate(tools)

    def desired(self, i: int) -> Array:
        """The goal of copy ``i``, shape (g,); default: the targets."""
        targets: Array = self.batch.target[i].ravel()
        return targets

    def goal_reward(self, achieved: Array, desired: Array, info: Any) -> Any:
        """Reward of goals with shapes (g,) or (N, g); default: 0 within the tolerance, else -1."""
        gaps = (achieved - desired).reshape(*achieved.shape[:-1], -1, 3)
        return 0.0 - (np.linalg.norm(gaps, axis=-1).max(axis=-1) >= self.tolerance)

    def aim(self, i: int, target: Array) -> None:
        """Replace the targets of copy ``i`` [m], shape (arms, 3), at the start of its episode."""
        self.batch.target[i] = target
        self.batch.plants[i].refresh()
        self.memory[i] = self.batch.metrics["distance"][i]

    def begin(self, i: int, rng: np.random.Generator, target: Array | None = None) -> None:
        """Begin an episode of copy ``i`` without an initial contact of the arm.

        Args:
            i: the copy.
            rng: its random draws.
            target: replaces the drawn targets [m], shape (arms, 3).

        Raises:
            StartsInContact: no such initial state was found.
        """
        for _ in range(BEGINNINGS):
            try:
                self.start(i, rng)
                break
            except StartsInContact as error:
                refused = error
        else:
            raise refused
        if target is not None:
            self.aim(i, target)
        self.look(i)

    def look(self, i: int) -> None:
        """Write what the task measures and observes of copy ``i`` into the batch."""
        batch = self.batch
        if self.measures:
            values = self.measure(i)
            if values.keys() != set(self.measures):
                raise ArgumentError(
                    f"{type(self).__name__}.measure: returned {', '.join(values) or 'nothing'}; "
                    f"expected {', '.join(self.measures)}"
                )
            for name, value in values.items():
                batch.metrics[name][i] = value
        if count := batch.own_entries:
            rows = batch.observations[-count:]
            seen: Array = np.array(self.observe(i), dtype=np.float64)
            if seen.shape != (count,):
                raise ArgumentError(
                    f"{type(self).__name__}.observe: shape {seen.shape}, expected ({count},): "
                    f"{', '.join(row.name for row in rows)}"
                )
            low, high = [row.low for row in rows], [row.high for row in rows]
            batch.observation[i, -count:] = np.clip(seen, low, high)

    def after(self, i: int, rng: np.random.Generator) -> None:
        """Prepare the next goal after a success of copy ``i``; the next observation has it."""

    def get_state(self) -> Any:
        """The state of the task besides :attr:`memory`."""
        return None

    def set_state(self, state: Any) -> None:
        """Restore what :meth:`get_state` returned."""


@cache
def step_type(measures: tuple[str, ...]) -> Any:
    """:class:`StepMetrics` with further fields.

    Raises:
        ArgumentError: a name that is no new identifier.
    """
    for name in measures:
        if not name.isidentifier() or name in StepMetrics._fields or name.startswith("_"):
            raise ArgumentError(f"measures: {name!r}; expected a new name of letters, digits and _")
    return namedtuple("StepMetrics", (*StepMetrics._fields, *measures)) if measures else StepMetrics


def task_of(task: Any, usual: type[Task]) -> type[Task]:
    """The class that the keyword ``task`` names: a class, "module:Name", or None for the usual one.

    Raises:
        ArgumentError: it is not a task.
    """
    if isinstance(task, str):
        module, _, name = task.partition(":")
        try:
            task = getattr(importlib.import_module(module), name)
        except (ImportError, AttributeError, ValueError) as error:
            raise ArgumentError(f"task {task!r}: {error}; expected module:Name") from None
    if task is None:
        return usual
    if not (isinstance(task, type) and issubclass(task, Task)):
        raise ArgumentError(
            f"task {task!r}: expected a subclass of tauguard.envs.tasks.Task (not an object of it)"
        )
    step_type(task.measures)
    return task


def build(
    task_type: type[Task], keywords: dict[str, Any], rows: int
) -> tuple[CompiledScene, Batch, Task]:
    """Scene, batch and task of an environment with these keywords.

    Things whose place the environment chooses are moved until initial states are free of contact.
    """
    own = {name: keywords.pop(name, value) for name, value in task_type.options.items()}
    settings = Settings.from_keywords(task_type.defaults, keywords, (*own, "task", "goal"))
    default, moved = frozenset(task_type.defaults) - keywords.keys(), dict[str, float]()
    for _ in range(MOVES + 1):
        compiled = compile_scene(settings, task_type, task_type.arms, moved, default)
        batch = Batch(compiled, rows, task_type.measures, task_type.entries(compiled))
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
