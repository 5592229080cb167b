"""The base of every environment: reset, step, ``info``, rendering and errors."""

from __future__ import annotations

from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike

from tauguard.arrays import Array
from tauguard.envs.gym.batch import TOUCHES, Batch, StepMetrics
from tauguard.envs.gym.compiled import CompiledScene
from tauguard.envs.gym.goals import Goals, goal_reward
from tauguard.envs.gym.randomization import check_options
from tauguard.envs.gym.rendering import HEIGHT, METHODS, WIDTH, Pictures
from tauguard.envs.gym.rules import Rules
from tauguard.envs.gym.task import Task, build, task_of
from tauguard.findings import ArgumentError
from tauguard.models import Scene

DIVERGED_REASON = (
    "diverged: a position is not finite, or a speed is beyond 1000 rad/s or m/s; use a smaller "
    "timestep"
)
RENDER_MODES = (*METHODS, "human")
#: Value of :attr:`StepMetrics.diverged` for an impossible force.
IMPOSSIBLE = 2
DIVERGED = StepMetrics._fields.index("diverged")


class ArmEnv(gymnasium.Env[Any, Array]):
    """One arm scene as a Gymnasium environment; each subclass sets ``task_type``.

    The keywords are those of :class:`tauguard.envs.gym.settings.Settings` and of the task.
    Every ``info`` has the same keys and shapes. A peak is the largest value over the physics steps
    of one action. Links and regions are counted from 1; 0 means none.

    | key | meaning |
    |---|---|
    | time, distance, success | time [s], distance to the target [m], goal reached |
    | force, link | peak contact force on a link [N], and which link |
    | excess | impulse beyond the limits of body regions, plus that between two arms [N s] |
    | cost | the part of the excess that the arm causes [N s] |
    | cost_sum | sum of the costs of the episode [N s] |
    | excess_cause | "arm": cost above 0; "region": a region ran into the arm; "": no excess |
    | limit_ratio, region | peak of force over limit, and of which region |
    | pressure | peak mean pressure [N/cm^2]; 0 without the keyword ``contact_area`` |
    | tau_ext, tau_ext_peak | external torque by joint, last and peak [N m] |
    | residual, alarm, fault | of the detector; fault: defect of the detector's samples, or "" |
    | onset, onset_time | whether a collision began; start of the latest one [s], -1: none |
    | alarm_delay | delay of the latest collision's alarm [s]; -1 without an alarm |
    | reason | why the episode was terminated or cut short, or "" |
    | reward_NAME | a term of the reward; the reward is their sum |
    | region_force, region_pressure | peaks of each of the k regions, shape (k,) [N, N/cm^2] |
    | region_point, region_direction | where [m], and the force's direction, shape (k, 3) |
    | contacts | with the keyword ``checkers``: number of pairs that each checker reported |

    The limit of a region's force is the transient limit. After 0.5 s of contact, or if the region
    cannot move, it is the quasi-static limit. In the cost, a force counts at most as much as the
    arm would exert on a person who stands still: the stiffness of the region times the distance
    that the arm has advanced in this contact. If ``limit_ratio`` is above 1 at a cost of 0,
    ``excess_cause`` is "region". Without ``contact_area`` the regions' pressures
    are estimates, see :attr:`tauguard.envs.gym.regions.RegionInfo.least_pressure`.

    The limits follow ISO 10218-2:2025. Some values could not be confirmed from an open source;
    ``unwrapped.regions`` marks them. A simulated force does not replace a measurement.
    """

    metadata = {"render_modes": list(RENDER_MODES), "render_fps": 100}  # noqa: RUF012
    task_type: ClassVar[type[Task]] = Task

    def __init__(
        self,
        render_mode: str | None = None,
        task: type[Task] | str | None = None,
        goal: bool = False,
        height: int = HEIGHT,
        width: int = WIDTH,
        view: str | None = None,
        **keywords: Any,
    ) -> None:
        """Compile the scene.

        Args:
            render_mode: "rgb_array", "depth_array" [m], "segmentation_array" (ids of bodies),
                "human" or None.
            task: a subclass of :class:`tauguard.envs.tasks.Task`, or "module:Name", in place of the
                environment's own task.
            goal: whether observations are dictionaries of ``observation``, ``achieved_goal`` and
                ``desired_goal``. The reward is then :meth:`compute_reward`, and a goal stays for
                the whole episode.
            height, width: of the pictures [px].
            view: "front", "left", "right", "top", or the name of a camera of the scene.
            **keywords: see :class:`tauguard.envs.gym.settings.Settings`.

        Raises:
            ArgumentError: an unknown keyword or a value out of range; the message says what would
                work.
            FileNotFoundError: no such robot file.
        """
        self.render_mode = render_mode
        self.pictures = Pictures(render_mode, height, width, view)
        shape = {"height": height, "width": width, "view": view}
        self._keywords = keywords | {"task": task, "goal": goal} | shape
        self.compiled, self.batch, self.task = build(task_of(task, self.task_type), keywords, 1)
        self.metadata = frame_rate(self.compiled)
        self.goals = Goals(self.batch, self.task) if goal else None
        self.action_space, self.observation_space = make_spaces(self.batch, self.goals)
        self._shape, self._area = self.action_space.shape, self.compiled.settings.contact_area
        #: Views of the rows of the only copy.
        self._seen, self._row = self.batch.observation[0], self.batch.numbers[0]
        self._arrays = {name: rows[0] for name, rows in shown_arrays(self.batch).items()}
        terms = ("goal",) if goal else self.task.terms
        self._reward_keys = {name: f"reward_{name}" for name in terms}
        self._looks = bool(self.task.measures or self.batch.own_entries)
        self._leaving = self.batch.objects.leaving
        #: What acts beside the policy: wrappers add to it.
        self.rules = Rules(self.batch)
        self._no_reward = dict.fromkeys(terms, 0.0)
        self._was_reset = False

    def __repr__(self) -> str:
        """The description of the batch, under this class's name."""
        return type(self).__name__ + repr(self.batch).removeprefix("Batch")

    @property
    def scene(self) -> Scene:
        """What is simulated: the compiled model, joint names, home pose, the arm's MJCF."""
        return self.compiled.scene

    @property
    def model(self) -> Any:
        """The compiled ``mujoco.MjModel``."""
        return self.batch.model(0)

    @property
    def data(self) -> Any:
        """The ``mujoco.MjData`` that is stepped; read it, do not write to it."""
        return self.batch.datas[0]

    @property
    def drawn(self) -> dict[str, Array]:
        """The values that ``randomize`` drew for this episode, by name."""
        return dict(self.batch.drawn[0])

    @property
    def regions(self) -> tuple[Any, ...]:
        """The body regions in the scene: names, limits, and which values are unconfirmed."""
        return self.compiled.regions

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: seed of all random draws.
            options: values by name that replace this episode's draws: ``target`` [m], shape
                (3 arms,), and the names of ``randomize``.

        Raises:
            ArgumentError: ``options`` has an unknown name, or a value out of range.
        """
        stated = dict(options or {})
        target = targets(stated.pop("target", None), 1, self.compiled.arms)[0]
        check_options(stated, self.compiled.settings.randomize or {}, ("target",))
        super().reset(seed=seed)
        self.batch.draw(0, self.np_random, stated)
        self.task.begin(0, self.np_random, target)
        self.rules.begin(0)
        self._was_reset = True
        if self.render_mode == "human":
            self.render()
        return self._observed(), self._info(self._metrics(), self._no_reward, False, "")

    def compute_reward(self, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: Any) -> Any:
        """Reward of reached and desired goals, shapes (g,) or (N, g); :meth:`Task.goal_reward`."""
        return goal_reward(self.task, achieved_goal, desired_goal, info)

    def _observed(self) -> Any:
        return self._seen.copy() if self.goals is None else self.goals.one(0)

    def step(self, action: ArrayLike) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Apply an action for one control step; entries beyond [-1, 1] count as -1 and 1.

        Raises:
            ArgumentError: an action of another shape, or with entries that are not finite.
        """
        if not self._was_reset:
            raise gymnasium.error.ResetNeeded("call reset before step")
        batch, task = self.batch, self.task
        values = np.array(action, np.float64)
        if values.shape != self._shape:
            raise ArgumentError(
                f"action: shape {values.shape}, expected {self._shape}: "
                f"{', '.join(entry.name for entry in batch.actions)}"
            )
        if self.rules:
            self.rules.act(0)
        batch.step(0, values, self.np_random)
        diverged = bool(self._row[DIVERGED])
        if self._looks and not diverged:
            task.look(0)
        step = self._metrics()
        rewards, success, task.memory[0], over = task.score(step, task.memory.item(0))
        why = (task.ended if success else task.failed) if over else ""
        if self._leaving and not over:
            why = batch.objects.reason(0)
            over = bool(why)
        if self.rules:
            self.rules.look(0)
            over = over or bool(self.rules.over()[0])
        reason = divergence(self.compiled, step.diverged) if diverged else why
        if self.goals is not None:
            reached, wanted = task.achieved(0), task.desired(0)
            rewards = {"goal": float(task.goal_reward(reached, wanted, {}))}
        info = self._info(step, rewards, success, reason)
        if success and not diverged and self.goals is None:
            task.after(0, self.np_random)
            if self._looks:
                task.look(0)
        if self.render_mode == "human":
            self.render()
        reward = float(sum(rewards.values()))
        return self._observed(), reward, over and not diverged, diverged, info

    def get_state(self) -> dict[str, Any]:
        """Everything that the next steps depend on, as plain arrays, for :meth:`set_state`."""
        return self.batch.get_state(0) | {
            "memory": np.array(self.task.memory),
            "task": self.task.get_state(),
            "rng": self.np_random.bit_generator.state,
            "begun": self._was_reset,
            "rules": self.rules.get_state(0),
        }

    def set_state(self, state: dict[str, Any]) -> None:
        """Restore a state of :meth:`get_state`; the same actions then give the same bits again.

        Raises:
            ArgumentError: the state is of another environment, or not from :meth:`get_state`.
        """
        known = {"memory", "task", "rng", "begun", "rules"}
        if not isinstance(state, dict) or not known <= state.keys():
            raise ArgumentError("state: expected what get_state() gave")
        self.batch.set_state(0, state)
        self.task.memory[:] = state["memory"]
        self.task.set_state(state["task"])
        self.np_random.bit_generator.state = state["rng"]
        self._was_reset = state["begun"]
        self.rules.set_state(0, state["rules"])

    def __getstate__(self) -> dict[str, Any]:
        """The keywords and the state of the environment; the window is not copied."""
        return {
            "made": (self.render_mode, self._keywords),
            "spec": self.spec,
            "rules": self.rules.made,
            "state": self.get_state(),
        }

    def __setstate__(self, saved: dict[str, Any]) -> None:
        """Make the environment again and restore its state."""
        mode, keywords = saved["made"]
        type(self).__init__(self, mode, **keywords)
        self.spec = saved["spec"]
        for kind, settings in saved["rules"]:
            self.rules.add(kind, **settings)
        self.set_state(saved["state"])

    def _metrics(self) -> Any:
        return self.task.step_type._make(self._row.tolist())

    def _info(
        self, step: StepMetrics, rewards: dict[str, Any], success: bool, reason: str
    ) -> dict[str, Any]:
        batch, area = self.batch, self._area
        info = {
            "time": step.time,
            "distance": step.distance,
            "success": success,
            "force": step.force,
            "cost": step.cost,
            "cost_sum": step.cost_sum,
            "excess": step.excess,
            "excess_cause": "arm" if step.cost > 0 else "region" if step.excess > 0 else "",
            "pressure": step.region_force / area if area else 0.0,
            "limit_ratio": step.limit_ratio,
            "region": int(step.region),
            "alarm": batch.alarm.item(0),
            "onset": step.onset != 0.0,
            "onset_time": step.onset_time,
            "link": int(step.link),
            "fault": batch.sensing[0].fault if batch.sensing else "",
            "alarm_delay": batch.alarm_delay.item(0),
            "reason": reason,
        }
        for name, row in self._arrays.items():
            info[name] = row.copy()
        for key, term in rewards.items():
            info[self._reward_keys[key]] = term
        for key in self.task.measures:
            info[key] = getattr(step, key)
        if self.goals is not None:
            info["is_success"] = success
        if self.rules:
            info |= {name: rows[0].item() for name, rows in self.rules.columns().items()}
        return info

    def render(self) -> Any:
        """A picture of shape (height, width, 3), or (height, width) of depths or bodies.

        ``human`` mode updates the window.
        """
        if self.render_mode is None:
            gymnasium.logger.warn("render_mode was not given to make: nothing to render")
            return None
        return self.pictures.draw(self.compiled, self.batch.datas[0], self.batch.target[0])

    def close(self) -> None:
        """Close the window or the renderer."""
        self.pictures.close()


def arm_env(env: gymnasium.Env[Any, Any]) -> ArmEnv:
    """The arm environment inside ``env``.

    Raises:
        ArgumentError: there is none.
    """
    inner = env.unwrapped
    if not isinstance(inner, ArmEnv):
        raise ArgumentError(
            f"{inner}: expected an environment of tauguard, such as tauguard/Reach-v0"
        )
    return inner


def divergence(compiled: CompiledScene, kind: float) -> str:
    """Why a simulation is not valid; ``kind`` is the value of :attr:`StepMetrics.diverged`."""
    if kind != IMPOSSIBLE:
        return DIVERGED_REASON
    return (
        f"diverged: a force beyond the {compiled.force_bound.total:.0f} N that the arm at its "
        "largest speed can exert"
    )


def shown_arrays(batch: Batch) -> dict[str, Array]:
    """The arrays of ``info``, one row per copy."""
    found = {
        "tau_ext": batch.tau_ext,
        "residual": batch.residual,
        "tau_ext_peak": batch.tau_peak,
        **{name: getattr(batch, name) for name in TOUCHES},
    }
    return found | {"contacts": batch.contacts} if batch.checks else found


def frame_rate(compiled: CompiledScene) -> dict[str, Any]:
    """Metadata of an environment, with one frame per action."""
    rate = max(1, round(compiled.settings.control_rate))
    return {"render_modes": list(RENDER_MODES), "render_fps": rate}


def targets(given: Any, rows: int, arms: int) -> list[Array | None]:
    """The target of each copy from ``options["target"]``; None: it is drawn.

    Raises:
        ArgumentError: not finite, or of another shape than (3 arms,), (arms, 3), and these with
            ``rows`` in front.
    """
    if given is None:
        return [None] * rows
    shapes: list[tuple[int, ...]] = [(3 * arms,), (arms, 3)]
    shapes += [(rows, *shape) for shape in shapes if rows > 1]
    try:
        values = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        values = np.zeros(0)
    if values.shape not in shapes or not np.isfinite(values).all():
        raise ArgumentError(
            f"options: target {given!r}: expected finite numbers [m] of shape "
            f"{' or '.join(map(str, shapes))}"
        )
    each = values.reshape(-1, arms, 3)
    return list(np.broadcast_to(each, (rows, arms, 3)))


def make_spaces(batch: Batch, goals: Goals | None = None) -> tuple[Any, Any]:
    """Spaces of the actions and observations of one environment."""
    low = np.array([entry.low for entry in batch.observations])
    high = np.array([entry.high for entry in batch.observations])
    action = spaces.Box(-1.0, 1.0, (len(batch.actions),), np.float32)
    return action, spaces.Box(low, high, dtype=np.float64) if goals is None else goals.space
