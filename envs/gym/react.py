"""React-v1: move along a path on which a person stands."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import mujoco
import numpy as np

from tauguard.arrays import Array
from tauguard.envs.gym.base import ArmEnv
from tauguard.envs.gym.batch import Batch, StepMetrics
from tauguard.envs.gym.compiled import find_tools
from tauguard.envs.gym.placing import Layout
from tauguard.envs.gym.task import Outcome, Task
from tauguard.envs.gym.vector import VectorArmEnv
from tauguard.findings import ArgumentError
from tauguard.models import BodyProxy, Person, Scene

#: Lengths of the path before and behind the tool's place at home [m].
RUN_UP, BEYOND = 0.25, 0.25
UP = np.array([0.0, 0.0, 1.0])  #: upward direction
BALL = 0.07  #: radius of the ball that stands for a body region [m]
LINK = 0.05  #: approximate radius of the last link around the tool [m]
#: Largest random shift of the path across its direction, in each of two directions [m].
ASIDE = 0.02
DONE = 0.03  #: distance from the end at which the path is done [m]
#: Weights of the terms of the reward.
DONE_PRIZE, LIMIT_PRICE, IMPULSE_PRICE, TIME_PRICE = 1.0, 1.0, 1.0, 0.1
#: Largest random shift of a body region along the path, as a fraction of ``RUN_UP``.
WHERE = 0.5


class React(Task):
    """Bring the tool to the path's end within the force limits of the person on it."""

    defaults: ClassVar[dict[str, Any]] = {"obstacles": ("chest",)}
    terms: ClassVar[tuple[str, ...]] = ("progress", "done", "limit", "impulse", "time")
    ended: ClassVar[str] = "the path's end is reached"
    failed: ClassVar[str] = "a force limit is exceeded"

    def __init__(self, batch: Batch, **options: Any) -> None:
        """Find the path.

        Raises:
            ArgumentError: there is no body region.
        """
        super().__init__(batch)
        if not batch.compiled.regions:
            raise ArgumentError("obstacles (): expected a body region to strike, such as 'chest'")
        scene, layout = batch.compiled.scene, batch.compiled.layout
        self._meeting, self.along = home_swing(scene, layout.own)
        self._across = np.array([np.cross(self.along, UP), UP])
        scale = min(1.0, layout.scale)
        self._run_up, self._beyond = scale * RUN_UP, scale * BEYOND

    @classmethod
    def proxy(cls, region: str, bare: Scene, layout: Layout) -> BodyProxy:
        """A body region on the path that is free to move along it."""
        tool, along = home_swing(bare, layout.own)
        away = max(1.0, layout.scale) * LINK + BALL + layout.moved.get(region, 0.0)
        x, y, z = (tool + away * along).tolist()
        return BodyProxy(region, (x, y, z), direction=tuple(along.tolist()), radius=BALL)

    @classmethod
    def person(cls, bare: Scene, layout: Layout) -> Person:
        """A person who stands with hanging arms and the chest on the path."""
        tool, along = home_swing(bare, layout.own)
        facing = -np.pi / 2 if layout.own else float(np.arctan2(-along[1], -along[0]))
        someone = Person(motion="still", facing=facing)
        thick = max(part.radius for part in someone.parts())
        x, y, z = (tool + LINK * along + thick * along).tolist()
        return replace(someone, position=(x, y), floor=z - someone.chest_height())

    def start(self, i: int, rng: np.random.Generator) -> None:
        """Place the tool at the beginning of the path, and the region somewhere along it."""
        batch, region = self.batch, self.batch.compiled.regions[0]
        begin = self._meeting + rng.uniform(-ASIDE, ASIDE, 2) @ self._across
        begin -= self._run_up * self.along
        batch.place(i, self.joints_at(begin))
        if region.joint >= 0:
            address = int(batch.compiled.scene.model.jnt_qposadr[region.joint])
            batch.datas[i].qpos[address] = rng.uniform(-WHERE, WHERE) * self._run_up
        batch.target[i, 0] = begin + (self._run_up + self._beyond) * self.along
        batch.send_people(i, rng)
        batch.start(i)
        self.memory[i] = batch.metrics["distance"][i]

    def score(self, step: StepMetrics, memory: Any) -> Outcome:
        """The reward's terms; ``memory`` is the last distance [m]."""
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

    The package's arm swings along y. Any other arm swings horizontally, at a right angle to the
    line from its first joint to its tool, so that no other link is on the path.
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
    """Bring the tool along a path on which a person stands, without exceeding a force limit.

    The tool begins at one end of a straight path of 0.5 m. A body region stands on the path and
    slides away when it is pushed; it is the chest unless ``obstacles`` names another. An arm that
    stands still does not reach the end, and a fast arm exceeds the region's limit. The arm has to
    touch the region slowly, give way, and go on.

    ## Actions (joint velocity, the default; n joints)

    | index | name | range | meaning of 1 |
    |---|---|---|---|
    | 0 .. n-1 | velocity of joint i | -1 to 1 | the joint's largest speed [rad/s] |

    The other control modes are the same as in Reach-v0.

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
    | done | 1 within 3 cm of the path's end; this ends the episode as a success |
    | limit | -1 for a force above the region's limit; this ends the episode |
    | impulse | -1 per second at the limit; proportional to the force |
    | time | -0.1 per second |
    """

    task_type = React


class ReactVectorEnv(VectorArmEnv):
    """Several copies of React-v1; see :class:`ReactEnv`."""

    task_type = React
