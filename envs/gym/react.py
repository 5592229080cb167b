"""React-v0: a collision has happened; choose the reaction."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, ClassVar

import mujoco
import numpy as np

from tauguard.arrays import Array
from tauguard.envs.gym.base import ArmEnv, Outcome, Task
from tauguard.envs.gym.batch import Batch, Override, StepMetrics
from tauguard.envs.gym.compiled import find_tools, tool_position
from tauguard.envs.gym.placing import Layout
from tauguard.envs.gym.settings import positive
from tauguard.envs.gym.vector import VectorArmEnv
from tauguard.models import BodyProxy, Person, Scene

#: The tool swings along y; it meets the region at the home pose, this far from the start [m].
RUN_UP = 0.25
#: The motion would have gone on this far [m].
BEYOND = 0.25
#: Upwards.
UP = np.array([0.0, 0.0, 1.0])
#: Radius of the ball that is hit, and of the last link around its tool, about [m].
BALL, LINK = 0.07, 0.05
#: The point of impact varies by this much across the swing [m], the speed by this fraction.
ASIDE, SPEED_SPREAD = 0.02, 0.2
#: Without an alarm the episode begins at the latest this long after the first touch [s].
PATIENCE = 0.1
#: At rest: no touch and every joint below this fraction of its largest speed, for this long [s].
REST_SPEED, REST_TIME = 0.02, 0.2
#: Weights of the reward a second: force over its limit, speed over the largest; at the end.
FORCE_PRICE, SPEED_PRICE, REST_PRIZE = 10.0, 1.0, 1.0
#: The path of React-v1 is done this near to its end [m]; the terms of its reward.
DONE, DONE_PRIZE, LIMIT_PRICE, IMPULSE_PRICE, TIME_PRICE = 0.03, 1.0, 1.0, 1.0, 0.1
#: The region stands within this fraction of the run-up around the meeting point.
WHERE = 0.5


class React(Task):
    """Reward: less for force and for speed, 1 for coming to rest without contact."""

    defaults: ClassVar[dict[str, Any]] = {"obstacles": ("chest",)}
    options: ClassVar[dict[str, Any]] = {"speed": 0.5, "approach": True}
    #: An episode begins at the touch.
    meets: ClassVar[bool] = True
    terms: ClassVar[tuple[str, ...]] = ("rest", "force", "speed")
    ended: ClassVar[str] = f"at rest without contact for {REST_TIME:g} s"

    def __init__(self, batch: Batch, **options: Any) -> None:
        """Take the task's own keywords.

        Args:
            batch: where it happens.
            **options: ``speed`` of the tool at the impact [m/s]; ``approach``: begin at the alarm
                or the touch (True), or before the motion (False).
        """
        super().__init__(batch)
        self._speed = float(options["speed"])
        positive("speed", self._speed)
        if not batch.compiled.regions:
            raise ValueError("obstacles (): expected a body region to strike, such as 'chest'")
        self._approach = bool(options["approach"])
        self._scratch = mujoco.MjData(batch.compiled.scene.model)
        scene, own = batch.compiled.scene, batch.compiled.layout.own
        self._meeting, self._along = home_swing(scene, own)
        self._across = np.array([np.cross(self._along, UP), UP])
        scale = min(1.0, batch.compiled.layout.scale)
        self._run_up, self._beyond = scale * RUN_UP, scale * BEYOND
        self.swing = [np.zeros((0, 0))] * batch.rows

    @classmethod
    def proxy(cls, region: str, bare: Scene, layout: Layout) -> BodyProxy:
        """On the path of the swing, free to move along it."""
        tool, along = home_swing(bare, layout.own)
        away = max(1.0, layout.scale) * LINK + BALL + layout.moved.get(region, 0.0)
        x, y, z = (tool + away * along).tolist()
        return BodyProxy(region, (x, y, z), direction=tuple(along.tolist()), radius=BALL)

    @classmethod
    def person(cls, bare: Scene, layout: Layout) -> Person:
        """Stands with hanging arms, the chest on the path of the swing."""
        tool, along = home_swing(bare, layout.own)
        facing = -np.pi / 2 if layout.own else float(np.arctan2(-along[1], -along[0]))
        someone = Person(motion="still", facing=facing)
        thick = max(part.radius for part in someone.parts())
        x, y, z = (tool + LINK * along + thick * along).tolist()
        return replace(someone, position=(x, y), floor=z - someone.chest_height())

    def start(self, i: int, rng: np.random.Generator) -> None:
        """Swing into the region, up to the alarm (with a detector) or the first touch."""
        batch, period = self.batch, 1 / self.batch.compiled.settings.control_rate
        aside = rng.uniform(-ASIDE, ASIDE, 2)
        begin = self._meeting + aside @ self._across - self._run_up * self._along
        speed = self._speed * (1 + rng.uniform(-SPEED_SPREAD, SPEED_SPREAD))
        self.swing[i] = self._plan(begin, speed, period)
        batch.place(i, self.swing[i][0])
        batch.target[i, 0] = begin + (self._run_up + self._beyond) * self._along
        batch.send_people(i, rng)
        batch.start(i)
        self.memory[i] = 0.0
        still = np.zeros(len(batch.actions))
        if batch.sensing is not None:  # a detector that must settle does so while the arm stands
            batch.plants[i].override(Override.VELOCITY, np.zeros(len(self.swing[i][0])))
            for _ in range(math.ceil(batch.sensing[i].settle / period - 1e-9)):
                batch.step(i, still, rng)
        speeds = np.diff(self.swing[i], axis=0) / period
        for speed in speeds if self._approach else speeds[:0]:
            batch.plants[i].override(Override.VELOCITY, speed)
            batch.step(i, still, rng)
            now = batch.metrics[i]
            since, touched = now["time"] - now["onset_time"], now["onset_time"] >= 0
            if touched and (batch.sensing is None or batch.alarm[i] or since >= PATIENCE):
                break
        batch.plants[i].override(Override.FREE, np.zeros(len(self.swing[i][0])))

    def get_state(self) -> Any:
        """The planned swing."""
        return [rows.copy() for rows in self.swing]

    def set_state(self, state: Any) -> None:
        """Go back to it."""
        self.swing = [rows.copy() for rows in state]

    def _plan(self, begin: Array, speed: float, period: float) -> Array:
        """Joint positions, one an action, of a straight swing that speeds up at once: (T, n)."""
        compiled, model, data = self.batch.compiled, self.batch.compiled.scene.model, self._scratch
        adr = compiled.scene.qpos_adr
        data.qpos[:] = model.qpos0
        data.qpos[adr] = compiled.scene.home
        self._move(begin, 30)
        rows = [data.qpos[adr].copy()]
        travelled, total = 0.0, self._run_up + self._beyond
        while travelled < total:
            ramp = np.sqrt(2 * (speed**2 / (0.8 * self._run_up)) * max(travelled, 1e-4))
            travelled += min(speed, ramp) * period
            self._move(begin + travelled * self._along, 2)
            rows.append(data.qpos[adr].copy())
        return np.array(rows)

    def _move(self, place: Array, rounds: int) -> None:
        """Bring the scratch copy's tool to ``place``, turning as little as it may."""
        compiled, model, data = self.batch.compiled, self.batch.compiled.scene.model, self._scratch
        jac, dofs = np.zeros((3, model.nv)), compiled.scene.dof_adr
        for _ in range(rounds):
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            tool = tool_position(compiled, data)
            mujoco.mj_jac(model, data, jac, None, tool, compiled.tools[0][1])
            part = jac[:, dofs]
            weight = np.linalg.solve(part @ part.T + 1e-4 * np.eye(3), place - tool)
            data.qpos[compiled.scene.qpos_adr] += np.clip(part.T @ weight, -0.2, 0.2)

    def score(self, step: StepMetrics, memory: Any) -> Outcome:
        """Force and speed cost; rest without contact ends it. It remembers the time at rest [s]."""
        period = 1 / self.batch.compiled.settings.control_rate
        calm = (step.force == 0) & (step.speed_ratio < REST_SPEED)
        rested = (memory + period) * calm
        over = rested >= REST_TIME - 1e-9
        rewards = {
            "rest": REST_PRIZE * over,
            "force": -period * FORCE_PRICE * step.limit_ratio,
            "speed": -period * SPEED_PRICE * step.speed_ratio,
        }
        return Outcome(rewards, success=over, memory=rested, terminated=over)


class ReactOnward(React):
    """Work goes on through the impact: bring the tool to the path's end within the limits."""

    options: ClassVar[dict[str, Any]] = {"speed": 0.5}
    terms: ClassVar[tuple[str, ...]] = ("progress", "done", "limit", "impulse", "time")
    ended: ClassVar[str] = "the path's end is reached"
    failed: ClassVar[str] = "a force limit is exceeded"
    meets: ClassVar[bool] = False

    def __init__(self, batch: Batch, **options: Any) -> None:
        """Take ``speed``, by which the swing of :class:`React` was planned."""
        super().__init__(batch, approach=False, **options)

    def start(self, i: int, rng: np.random.Generator) -> None:
        """At the beginning of the path; the region stands somewhere along it."""
        super().start(i, rng)
        batch, region = self.batch, self.batch.compiled.regions[0]
        if region.joint >= 0:
            address = int(batch.compiled.scene.model.jnt_qposadr[region.joint])
            batch.datas[i].qpos[address] = rng.uniform(-WHERE, WHERE) * self._run_up
            batch.start(i)
        batch.plants[i].refresh()
        self.memory[i] = batch.metrics["distance"][i]

    def score(self, step: StepMetrics, memory: Any) -> Outcome:
        """Progress, and what it costs. It remembers the last distance [m]."""
        period = 1 / self.batch.compiled.settings.control_rate
        hurt = step.limit_ratio > 1
        done = (step.distance < DONE) & (step.limit_ratio <= 1)
        rewards = {
            "progress": memory - step.distance,
            "done": DONE_PRIZE * done,
            "limit": -LIMIT_PRICE * hurt,
            "impulse": -IMPULSE_PRICE * period * step.limit_ratio,
            "time": -TIME_PRICE * period + 0.0 * step.distance,
        }
        return Outcome(rewards, success=done, memory=step.distance, terminated=done | hurt)


def home_swing(scene: Scene, own: bool) -> tuple[Array, Array]:
    """Where the tool is at home [m], and the direction of its swing, shapes (3,).

    The package's arm swings along y; any other horizontally, across the line from its first joint
    to its tool, so that no other link is on the path.
    """
    model, data = scene.model, mujoco.MjData(scene.model)
    data.qpos[scene.qpos_adr] = scene.home
    mujoco.mj_kinematics(model, data)
    site, body, _ = find_tools(scene, 1)[0]
    tool = np.array(data.site_xpos[site] if site >= 0 else data.xpos[body])
    along = np.array([0.0, 1.0, 0.0])
    if not own:
        x, y, _ = tool - data.xanchor[model.joint(scene.joint_names[0]).id]
        size = float(np.hypot(x, y))
        along = np.array([-y, x, 0.0]) / size if size > 1e-6 else along
    return tool, along


class ReactEnv(ArmEnv):
    """A swinging tool has hit a body region: choose what the arm does next.

    An episode begins at the first touch, or with ``detector=`` at its alarm (at the latest 0.1 s
    after the touch); with ``approach=False`` it begins before the swing. A trained detector settles
    first, while the arm stands. ``speed`` is that of the
    tool at the impact [m/s], varied by 20 %.

    ## Actions (joint velocity, the default; n joints)

    | index | name | range | meaning of 1 |
    |---|---|---|---|
    | 0 .. n-1 | velocity of joint i | -1 to 1 | the joint's largest speed [rad/s] |

    The other control modes are those of Reach-v0. An action of 0 here is a category-2 stop; the
    wrapper :class:`tauguard.envs.wrappers.Reaction` has the usual ones.

    ## Observations (n joints, one body region; 3 n + 12 numbers)

    | index | name | range | unit |
    |---|---|---|---|
    | 0 .. n-1 | position of joint i | its range and 0.5 beyond | rad |
    | n .. 2n-1 | velocity of joint i | -100 to 100 | rad/s |
    | 2n .. 3n-1 | motor torque of joint i, nominal gain times current | 1.5 times limit | N m |
    | 3n .. 3n+2 | position of the tool | -100 to 100 | m |
    | 3n+3 .. 3n+5 | where the swing would have ended, less tool | -100 to 100 | m |
    | 3n+6 .. 3n+8 | position of the region | -100 to 100 | m |
    | 3n+9 .. 3n+11 | velocity of the region | -100 to 100 | m/s |

    ## Reward and end

    A second costs 10 times the force over the region's limit and the fastest joint's speed over
    its largest. Rest without contact for 0.2 s ends the episode and is worth 1.
    """

    task_type = React


class ReactOnwardEnv(ArmEnv):
    """Bring the tool along a path on which somebody stands, without hurting them.

    The tool begins at one end of a straight path of 0.5 m; a body region, the chest unless
    ``obstacles`` says otherwise, stands on it and slides away when it is pushed. Standing still
    reaches nothing, going fast exceeds the region's limit: the arm has to arrive gently, yield, and
    go on.

    Actions and observations are those of React-v0.

    ## Reward and end

    | term | value |
    |---|---|
    | progress | how much nearer the tool came to the path's end [m] |
    | done | 1 within 3 cm of it; this ends the episode as a success |
    | limit | -1 for a force above the region's limit; this ends the episode |
    | impulse | -1 for each second at the limit, less force less |
    | time | -0.1 a second |
    """

    task_type = ReactOnward


class ReactOnwardVectorEnv(VectorArmEnv):
    """Many React-v1 at once; see :class:`ReactOnwardEnv`."""

    task_type = ReactOnward


class ReactVectorEnv(VectorArmEnv):
    """Many React-v0 at once; see :class:`ReactEnv`."""

    task_type = React
