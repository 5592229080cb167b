"""React-v1: work goes on where somebody stands on the path."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import mujoco
import numpy as np

from tauguard.arrays import Array
from tauguard.envs.gym.base import ArmEnv
from tauguard.envs.gym.batch import Batch, StepMetrics
from tauguard.envs.gym.compiled import find_tools, tool_position
from tauguard.envs.gym.placing import Layout
from tauguard.envs.gym.task import Outcome, Task
from tauguard.envs.gym.vector import VectorArmEnv
from tauguard.models import BodyProxy, Person, Scene

#: The path goes along y through the tool's place at home; its lengths before and behind it [m].
RUN_UP, BEYOND = 0.25, 0.25
#: The upward direction.
UP = np.array([0.0, 0.0, 1.0])
#: Approximate radii of the ball that is hit, and of the last link around its tool [m].
BALL, LINK = 0.07, 0.05
#: The path varies by this much across its direction [m].
ASIDE = 0.02
#: Distance from the end at which the path is done [m]; weights of the terms of the reward.
DONE, DONE_PRIZE, LIMIT_PRICE, IMPULSE_PRICE, TIME_PRICE = 0.03, 1.0, 1.0, 1.0, 0.1
#: The region stands within this fraction of the run-up around the tool's place at home.
WHERE = 0.5
#: Number of steps of the inverse kinematics from home to the start of the path.
ROUNDS = 30


class React(Task):
    """Bring the tool to the path's end within the force limits of the person on it."""

    defaults: ClassVar[dict[str, Any]] = {"obstacles": ("chest",)}
    terms: ClassVar[tuple[str, ...]] = ("progress", "done", "limit", "impulse", "time")
    ended: ClassVar[str] = "the path's end is reached"
    failed: ClassVar[str] = "a force limit is exceeded"

    def __init__(self, batch: Batch, **options: Any) -> None:
        """Find the path.

        Raises:
            ValueError: there is no body region.
        """
        super().__init__(batch)
        if not batch.compiled.regions:
            raise ValueError("obstacles (): expected a body region to strike, such as 'chest'")
        scene, layout = batch.compiled.scene, batch.compiled.layout
        self._scratch = mujoco.MjData(scene.model)
        self._meeting, self.along = home_swing(scene, layout.own)
        self._across = np.array([np.cross(self.along, UP), UP])
        scale = min(1.0, layout.scale)
        self._run_up, self._beyond = scale * RUN_UP, scale * BEYOND

    @classmethod
    def proxy(cls, region: str, bare: Scene, layout: Layout) -> BodyProxy:
        """On the path, free to move along it."""
        tool, along = home_swing(bare, layout.own)
        away = max(1.0, layout.scale) * LINK + BALL + layout.moved.get(region, 0.0)
        x, y, z = (tool + away * along).tolist()
        return BodyProxy(region, (x, y, z), direction=tuple(along.tolist()), radius=BALL)

    @classmethod
    def person(cls, bare: Scene, layout: Layout) -> Person:
        """Stands with hanging arms, the chest on the path."""
        tool, along = home_swing(bare, layout.own)
        facing = -np.pi / 2 if layout.own else float(np.arctan2(-along[1], -along[0]))
        someone = Person(motion="still", facing=facing)
        thick = max(part.radius for part in someone.parts())
        x, y, z = (tool + LINK * along + thick * along).tolist()
        return replace(someone, position=(x, y), floor=z - someone.chest_height())

    def start(self, i: int, rng: np.random.Generator) -> None:
        """At the beginning of the path; the region stands somewhere along it."""
        batch, region = self.batch, self.batch.compiled.regions[0]
        begin = self._meeting + rng.uniform(-ASIDE, ASIDE, 2) @ self._across
        begin -= self._run_up * self.along
        batch.place(i, self._joints(begin))
        if region.joint >= 0:
            address = int(batch.compiled.scene.model.jnt_qposadr[region.joint])
            batch.datas[i].qpos[address] = rng.uniform(-WHERE, WHERE) * self._run_up
        batch.target[i, 0] = begin + (self._run_up + self._beyond) * self.along
        batch.send_people(i, rng)
        batch.start(i)
        self.memory[i] = batch.metrics["distance"][i]

    def _joints(self, place: Array) -> Array:
        """Joint positions near home with the tool at ``place`` [rad], shape (n,)."""
        compiled, model, data = self.batch.compiled, self.batch.compiled.scene.model, self._scratch
        adr, dofs = compiled.scene.qpos_adr, compiled.scene.dof_adr
        data.qpos[adr] = compiled.scene.home
        jac = np.zeros((3, model.nv))
        for _ in range(ROUNDS):
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            tool = tool_position(compiled, data)
            mujoco.mj_jac(model, data, jac, None, tool, compiled.tools[0][1])
            part = jac[:, dofs]
            weight = np.linalg.solve(part @ part.T + 1e-4 * np.eye(3), place - tool)
            data.qpos[adr] += np.clip(part.T @ weight, -0.2, 0.2)
        return np.array(data.qpos[adr])

    def score(self, step: StepMetrics, memory: Any) -> Outcome:
        """The reward's terms. The memory is the last distance [m]."""
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
        return Outcome(rewards, done, step.distance, done | hurt)


def home_swing(scene: Scene, own: bool) -> tuple[Array, Array]:
    """Position of the tool at home [m], and direction of its swing, shapes (3,).

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
    """Bring the tool along a path on which somebody stands, without hurting them.

    The tool begins at one end of a straight path of 0.5 m; a body region, the chest unless
    ``obstacles`` says otherwise, stands on it and slides away when it is pushed. Standing still
    reaches nothing, going fast exceeds the region's limit: the arm has to arrive gently, yield, and
    go on.

    ## Actions (joint velocity, the default; n joints)

    | index | name | range | meaning of 1 |
    |---|---|---|---|
    | 0 .. n-1 | velocity of joint i | -1 to 1 | the joint's largest speed [rad/s] |

    The other control modes are those of Reach-v0.

    ## Observations (n joints, one body region; 3 n + 12 numbers)

    | index | name | range | unit |
    |---|---|---|---|
    | 0 .. n-1 | position of joint i | its range and 0.5 beyond | rad |
    | n .. 2n-1 | velocity of joint i | -100 to 100 | rad/s |
    | 2n .. 3n-1 | motor torque of joint i, nominal gain times current | 1.5 times limit | N m |
    | 3n .. 3n+2 | position of the tool | -100 to 100 | m |
    | 3n+3 .. 3n+5 | the path's end less tool | -100 to 100 | m |
    | 3n+6 .. 3n+8 | position of the region | -100 to 100 | m |
    | 3n+9 .. 3n+11 | velocity of the region | -100 to 100 | m/s |

    ## Reward and end

    | term | value |
    |---|---|
    | progress | how much nearer the tool came to the path's end [m] |
    | done | 1 within 3 cm of it; this ends the episode as a success |
    | limit | -1 for a force above the region's limit; this ends the episode |
    | impulse | -1 for each second at the limit, less force less |
    | time | -0.1 a second |
    """

    task_type = React


class ReactVectorEnv(VectorArmEnv):
    """Many React-v1 at once; see :class:`ReactEnv`."""

    task_type = React
