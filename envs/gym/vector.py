"""Several copies of an environment, stepped on threads; bit-equal to single environments."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike

from tauguard.arrays import Array, Bools
from tauguard.envs.gym.base import (
    divergence,
    frame_rate,
    make_spaces,
    shown_arrays,
    targets,
)
from tauguard.envs.gym.goals import Goals, goal_reward
from tauguard.envs.gym.randomization import check_options
from tauguard.envs.gym.rendering import HEIGHT, WIDTH, Pictures
from tauguard.envs.gym.rules import Rules
from tauguard.envs.gym.task import Task, build, task_of
from tauguard.envs.gym.vectorised import check_vectorised
from tauguard.findings import ArgumentError


class VectorArmEnv(VectorEnv[Any, Array, Array]):
    """``num_envs`` copies of an :class:`tauguard.envs.gym.base.ArmEnv`, stepped on a thread pool.

    Results equal those of single environments bit for bit, for any number of threads. The scene is
    compiled once and shared. By ``autoreset_mode``, a finished copy begins a new episode at the
    next step (``NEXT_STEP``), in the same step (``SAME_STEP``), or when ``reset`` is called.
    """

    task_type: ClassVar[type[Task]] = Task

    def __init__(
        self,
        num_envs: int = 1,
        *,
        max_episode_steps: int | None = None,
        threads: int = 0,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        task: type[Task] | str | None = None,
        goal: bool = False,
        height: int = HEIGHT,
        width: int = WIDTH,
        view: str | None = None,
        **keywords: Any,
    ) -> None:
        """Compile the scene once.

        Args:
            num_envs: number of copies.
            max_episode_steps: number of actions after which an episode is truncated.
            threads: number of threads; 0 means all processors.
            autoreset_mode: "NextStep", "SameStep" or "Disabled".
            render_mode: as for the single environment; "human" shows the first copy.
            task, goal, height, width, view: as for the single environment.
            **keywords: as for the single environment.

        Raises:
            ArgumentError: a keyword out of range, or a task that cannot score arrays.
        """
        if num_envs < 1:
            raise ArgumentError(f"num_envs {num_envs}: expected 1 or more")
        if threads < 0:
            raise ArgumentError(f"threads {threads}: expected 0 (all processors) or more")
        self.pictures = Pictures(render_mode, height, width, view)
        self.num_envs, self.render_mode, self._threads = num_envs, render_mode, threads
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        chosen = task_of(task, self.task_type)
        self.compiled, self.batch, self.task = build(chosen, keywords, num_envs)
        check_vectorised(self.task, num_envs)
        self.metadata = frame_rate(self.compiled) | {"autoreset_mode": self.autoreset_mode}
        self.goals = Goals(self.batch, self.task) if goal else None
        self._terms = ("goal",) if goal else self.task.terms
        self._looks = bool(self.task.measures or self.batch.own_entries)
        spaces = make_spaces(self.batch, self.goals)
        self.single_action_space, self.single_observation_space = spaces
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._limit, self._arrays = max_episode_steps, shown_arrays(self.batch)
        self._elapsed = np.zeros(num_envs, dtype=np.int64)
        self._over = np.zeros(num_envs, dtype=np.bool_)
        self._rngs: list[np.random.Generator] = [seeding.np_random(None)[0]] * num_envs
        self._seeded = False
        #: What acts beside the policy: wrappers add to it.
        self.rules = Rules(self.batch)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode of every copy, or of the copies in ``options["reset_mask"]``.

        Args:
            seed: copy i gets ``seed + i``, or entry i of a list.
            options: ``reset_mask``, a bool array of shape (num_envs,), and values by name that
                replace the draws of these episodes, as for the single environment; ``target`` can
                have one row per copy.
        """
        stated = {key: value for key, value in (options or {}).items() if key != "reset_mask"}
        places = targets(stated.pop("target", None), self.num_envs, self.compiled.arms)
        known = self.compiled.settings.randomize or {}
        check_options(stated, known, ("target", "reset_mask"))
        if isinstance(seed, list):
            seeds = seed
        else:
            seeds = [None if seed is None else seed + i for i in range(self.num_envs)]
        if len(seeds) != self.num_envs:
            raise ArgumentError(f"seed: {len(seeds)} entries, expected {self.num_envs}")
        for i, one in enumerate(seeds):
            if one is not None or not self._seeded:
                self._rngs[i] = seeding.np_random(one)[0]
        self._seeded = True
        mask = self._chosen((options or {}).get("reset_mask"))
        for k in np.flatnonzero(mask):
            self._begin(int(k), stated, places[k])
        none = np.zeros_like(mask)
        infos = self._infos(self._no_reward(), none, mask, self._metrics())
        return self._observed(), infos

    def compute_reward(self, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: Any) -> Any:
        """Reward of reached and desired goals, shapes (g,) or (N, g); :meth:`Task.goal_reward`."""
        return goal_reward(self.task, achieved_goal, desired_goal, info)

    def _observed(self) -> Any:
        return self.batch.observation.copy() if self.goals is None else self.goals.all()

    def _chosen(self, mask: Any) -> Bools:
        if mask is None:
            return np.ones(self.num_envs, dtype=np.bool_)
        if not (isinstance(mask, np.ndarray) and mask.shape == (self.num_envs,)):
            raise ArgumentError(f"reset_mask: expected a bool array of shape ({self.num_envs},)")
        return mask.astype(np.bool_)

    def _begin(
        self, i: int, stated: Mapping[str, Any] = MappingProxyType({}), target: Array | None = None
    ) -> None:
        self.batch.draw(i, self._rngs[i], stated)
        self.task.begin(i, self._rngs[i], target)
        self.rules.begin(i)
        self._elapsed[i], self._over[i] = 0, False

    def step(  # type: ignore[override]
        self, actions: ArrayLike
    ) -> tuple[Any, Array, Bools, Bools, dict[str, Any]]:
        """Apply one action to every copy.

        Raises:
            ArgumentError: actions of another shape, or with entries that are not finite.
        """
        batch = self.batch
        values = np.ascontiguousarray(actions, dtype=np.float64)
        if values.shape != self.action_space.shape:
            raise ArgumentError(
                f"actions: shape {values.shape}, expected {self.action_space.shape}: "
                "one row per copy"
            )
        if not self._seeded:
            raise gymnasium.error.ResetNeeded("call reset before step")
        going = ~self._over
        if self._over.any() and self.autoreset_mode is AutoresetMode.DISABLED:
            raise gymnasium.error.ResetNeeded(
                f"copies {np.flatnonzero(self._over)} are over: reset them with a reset_mask"
            )
        if self.rules:
            for k in going.nonzero()[0]:
                self.rules.act(int(k))
        batch.step_all(values, going, self._rngs, self._threads)
        task, diverged = self.task, batch.metrics["diverged"] != 0
        if self._looks:
            for i in (going & ~diverged).nonzero()[0]:
                task.look(int(i))
        step = self._metrics()
        terms, successes, task.memory[:], ends = task.score(step, task.memory.copy())
        overs = ends = np.broadcast_to(ends, diverged.shape)
        left = {} if not batch.objects.leaving else self._left(going & ~diverged & ~overs)
        if left:
            overs = np.isin(np.arange(self.num_envs), list(left)) | overs
        if self.rules:
            for k in going.nonzero()[0]:
                self.rules.look(int(k))
            overs = overs | self.rules.over()
        if self.goals is not None:
            seen = self.goals.all()
            reached, wanted = seen["achieved_goal"], seen["desired_goal"]
            terms = {"goal": task.goal_reward(reached, wanted, {})}
        self._elapsed += going
        late = self._elapsed >= self._limit if self._limit else np.zeros_like(diverged)
        terminated = overs & ~diverged & going
        truncated = (diverged | late) & going
        terms = {name: np.where(going, term, 0.0) for name, term in terms.items()}
        rewards = sum(terms.values(), np.zeros(self.num_envs))
        fresh = (~going).nonzero()[0]
        for i in fresh:
            self._begin(int(i))
        if fresh.size:
            step = self._metrics()
        infos = self._infos(terms, successes & going, np.ones_like(going), step)
        infos["reason"][terminated & ends & successes] = task.ended
        infos["reason"][terminated & ends & ~successes] = task.failed
        for i, why in left.items():
            infos["reason"][i] = why
        for i in (successes & going & ~diverged).nonzero()[0] if self.goals is None else ():
            task.after(int(i), self._rngs[i])
            if self._looks:
                task.look(int(i))
        self._over = terminated | truncated
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self._over.any():
            infos = self._restart(infos)
        if self.render_mode == "human":
            self.render()
        return self._observed(), rewards, terminated, truncated, infos

    def _left(self, going: Bools) -> dict[int, str]:
        """The copies that end because an object left the workspace, and why."""
        reasons = {int(i): self.batch.objects.reason(int(i)) for i in going.nonzero()[0]}
        return {i: why for i, why in reasons.items() if why}

    def _restart(self, infos: dict[str, Any]) -> dict[str, Any]:
        """Restart finished copies (SAME_STEP); keys ``final_...`` keep their last values."""
        done = self._over.copy()
        observations = np.full(self.num_envs, None, dtype=object)
        for i in np.flatnonzero(done):
            one = self.batch.observation[i].copy() if self.goals is None else self.goals.one(int(i))
            observations[i] = one
        final = {key: value.copy() for key, value in infos.items()}
        for key in [k for k in final if not k.startswith("_")]:
            final[key][~done] = np.zeros_like(final[key][~done])
            final[f"_{key}"] = done.copy()
        for i in np.flatnonzero(done):
            self._begin(int(i))
        fresh = self._infos(self._no_reward(), np.zeros_like(done), done, self._metrics())
        for key in [k for k in infos if not k.startswith("_")]:
            infos[key][done] = fresh[key][done]
        return {
            "final_obs": observations,
            "_final_obs": done,
            "final_info": final,
            "_final_info": done.copy(),
        } | infos

    def _metrics(self) -> Any:
        """The results of the last action, as copies that the next action does not overwrite."""
        return self.task.step_type._make(self.batch.numbers.T.copy())

    def _no_reward(self) -> dict[str, Array]:
        return {name: np.zeros(self.num_envs) for name in self._terms}

    def _infos(
        self, terms: dict[str, Array], success: Bools, mask: Bools, step: Any
    ) -> dict[str, Any]:
        batch, area = self.batch, self.compiled.settings.contact_area
        reason = np.full(self.num_envs, "", dtype=object)
        for i in step.diverged.nonzero()[0]:
            reason[i] = divergence(self.compiled, step.diverged[i])
        infos: dict[str, Any] = {
            "time": step.time,
            "distance": step.distance,
            "success": success.copy(),
            "force": step.force,
            "cost": step.cost,
            "cost_sum": step.cost_sum,
            "excess": step.excess,
            "excess_cause": causes(step),
            "pressure": step.region_force / area if area else np.zeros(self.num_envs),
            "limit_ratio": step.limit_ratio,
            "region": step.region.astype(np.int64),
            "alarm": batch.alarm.copy(),
            "onset": step.onset != 0,
            "onset_time": step.onset_time,
            "link": step.link.astype(np.int64),
            "fault": np.array(batch.faults(), dtype=object),
            "alarm_delay": batch.alarm_delay.copy(),
            "reason": reason,
        } | {name: rows.copy() for name, rows in self._arrays.items()}
        infos |= {f"reward_{name}": term for name, term in terms.items()}
        infos |= {name: getattr(step, name) for name in self.task.measures}
        if self.goals is not None:
            infos["is_success"] = infos["success"]
        infos |= self.rules.columns()
        shown = mask.copy()
        return infos | {f"_{key}": shown for key in infos}

    def render(self) -> Any:
        """A tuple with a picture of each copy; in "human" mode the first is shown."""
        if self.render_mode is None:
            return None
        batch, draw = self.batch, self.pictures.draw
        if self.render_mode == "human":
            return draw(self.compiled, batch.datas[0], batch.target[0])
        rows = zip(batch.datas, batch.target, strict=True)
        return tuple(draw(self.compiled, data, target) for data, target in rows)

    def close_extras(self, **kwargs: Any) -> None:
        """Close the pictures."""
        self.pictures.close()


def vector_arm_env(env: VectorEnv[Any, Any, Any]) -> VectorArmEnv:
    """The vector environment of arms inside ``env``.

    Raises:
        ArgumentError: there is none.
    """
    inner = env.unwrapped
    if not isinstance(inner, VectorArmEnv):
        raise ArgumentError(
            f"{inner}: expected what gymnasium.make_vec makes of an environment of tauguard; wrap "
            "the single environments of a SyncVectorEnv"
        )
    return inner


def causes(step: Any) -> Any:
    """``info["excess_cause"]`` of every copy."""
    cause = np.full(len(step.cost), "", dtype=object)
    cause[step.excess > 0], cause[step.cost > 0] = "region", "arm"
    return cause
