"""React-v0: a collision has happened; choose the reaction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar

import mujoco
import numpy as np

from tauguard.arrays import Array
from tauguard.envs.gym.base import ArmEnv, Task
from tauguard.envs.gym.cell import FORCE, FREE, ONSET_TIME, RATIO, SPEED, TIME, VELOCITY, Cell
from tauguard.envs.gym.settings import positive
from tauguard.envs.gym.vector import VectorArmEnv
from tauguard.envs.gym.world import World, find_tools, tool_position
from tauguard.models import BodyProxy, Person, Scene

#: The tool swings along y and meets the region at its home pose, this far behind the start [m].
RUN_UP = 0.25
#: The motion would have gone on this far [m].
BEYOND = 0.25
#: Radius of the struck ball, and of the last link around its tool, about [m].
BALL, LINK = 0.07, 0.05
#: The struck point varies by this much across the swing [m], the speed by this share.
ASIDE, SPEED_SHARE = 0.02, 0.2
#: Without an alarm the episode begins at the latest this long after the first touch [s].
PATIENCE = 0.1
#: At rest: no touch and every joint below this share of its largest speed, for this long [s].
REST_SPEED, REST_TIME = 0.02, 0.2
#: Weights of the reward a second: force over its limit, speed over the largest; at the end.
FORCE_PRICE, SPEED_PRICE, REST_PRIZE = 10.0, 1.0, 1.0


class React(Task):
    """Reward: less for force and for speed, 1 for coming to rest without contact."""

    defaults: ClassVar[dict[str, Any]] = {"obstacles": ("chest",)}
    options: ClassVar[dict[str, Any]] = {"speed": 0.5, "approach": True}

    def __init__(self, cell: Cell, **options: Any) -> None:
        """Take the task's own keywords.

        Args:
            cell: where it happens.
            **options: ``speed`` of the tool at the blow [m/s], ``approach``: begin at the alarm or
                the touch (True), or before the motion (False).
        """
        super().__init__(cell)
        self._speed = float(options["speed"])
        positive("speed", self._speed)
        if not cell.world.regions:
            raise ValueError("obstacles (): expected a body region to strike, such as 'chest'")
        self._approach = bool(options["approach"])
        self._scratch = mujoco.MjData(cell.world.scene.model)
        self._meeting = home_tool(cell.world)
        self.swing = [np.zeros((0, 0))] * cell.rows

    @classmethod
    def proxy(cls, region: str, bare: Scene, reach: float) -> BodyProxy:
        """In the way of the swing, free to give way along it."""
        data = mujoco.MjData(bare.model)
        data.qpos[bare.qpos_adr] = bare.home
        mujoco.mj_kinematics(bare.model, data)
        x, y, z = _bare_tool(bare, data)
        return BodyProxy(region, (x, y + LINK + BALL, z), direction=(0.0, 1.0, 0.0), radius=BALL)

    @classmethod
    def person(cls, bare: Scene, reach: float) -> Person:
        """Stands with hanging arms, the chest in the way of the swing."""
        data = mujoco.MjData(bare.model)
        data.qpos[bare.qpos_adr] = bare.home
        mujoco.mj_kinematics(bare.model, data)
        x, y, z = _bare_tool(bare, data)
        someone = Person(motion="still", facing=-np.pi / 2)
        thick = max(part.radius for part in someone.parts())
        return replace(
            someone, position=(x, y + LINK + thick), floor=float(z) - someone.chest_height()
        )

    def start(self, i: int, rng: np.random.Generator) -> None:
        """Swing into the region, up to the alarm (with a detector) or the first touch."""
        cell, period = self.cell, 1 / self.cell.world.settings.control_rate
        aside = rng.uniform(-ASIDE, ASIDE, 2)
        begin = self._meeting + np.array([aside[0], -RUN_UP, aside[1]])
        speed = self._speed * (1 + rng.uniform(-SPEED_SHARE, SPEED_SHARE))
        self.swing[i] = self._plan(begin, speed, period)
        cell.place(i, self.swing[i][0])
        cell.target[i, 0] = begin + np.array([0.0, RUN_UP + BEYOND, 0.0])
        cell.send_person(i, rng)
        cell.start(i)
        self.memory[i] = 0.0
        still = np.zeros(len(cell.actions))
        if cell.sensing is not None:  # a detector that must settle does so while the arm stands
            cell.plants[i].override(VELOCITY, np.zeros(len(self.swing[i][0])))
            for _ in range(math.ceil(cell.sensing[i].settle / period - 1e-9)):
                cell.step(i, still, rng)
        way = np.diff(self.swing[i], axis=0) / period
        for speeds in way if self._approach else way[:0]:
            cell.plants[i].override(VELOCITY, speeds)
            cell.step(i, still, rng)
            since = cell.figure[i, TIME] - cell.figure[i, ONSET_TIME]
            touched = cell.figure[i, ONSET_TIME] >= 0
            if touched and (cell.sensing is None or cell.alarm[i] or since >= PATIENCE):
                break
        cell.plants[i].override(FREE, np.zeros(len(self.swing[i][0])))

    def get_state(self) -> Any:
        """The planned swing."""
        return [rows.copy() for rows in self.swing]

    def set_state(self, state: Any) -> None:
        """Go back to it."""
        self.swing = [rows.copy() for rows in state]

    def _plan(self, begin: Array, speed: float, period: float) -> Array:
        """Joint positions, one an action, of a straight swing that speeds up at once: (T, n)."""
        world, model, data = self.cell.world, self.cell.world.scene.model, self._scratch
        adr = world.scene.qpos_adr
        data.qpos[:] = model.qpos0
        data.qpos[adr] = world.scene.home
        self._move(begin, 30)
        rows = [data.qpos[adr].copy()]
        travelled, total = 0.0, RUN_UP + BEYOND
        while travelled < total:
            ramp = np.sqrt(2 * (speed**2 / (0.8 * RUN_UP)) * max(travelled, 1e-4))
            travelled += min(speed, ramp) * period
            self._move(begin + np.array([0.0, travelled, 0.0]), 2)
            rows.append(data.qpos[adr].copy())
        return np.array(rows)

    def _move(self, place: Array, rounds: int) -> None:
        """Bring the scratch copy's tool to ``place``, turning as little as it may."""
        world, model, data = self.cell.world, self.cell.world.scene.model, self._scratch
        jac, dofs = np.zeros((3, model.nv)), world.scene.dof_adr
        for _ in range(rounds):
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            tool = tool_position(world, data)
            mujoco.mj_jac(model, data, jac, None, tool, world.tools[0][1])
            part = jac[:, dofs]
            way = np.linalg.solve(part @ part.T + 1e-4 * np.eye(3), place - tool)
            data.qpos[world.scene.qpos_adr] += np.clip(part.T @ way, -0.2, 0.2)

    def score(self, figure: Sequence[Any], memory: Any) -> tuple[Any, Any, Any, Any]:
        """Force and speed cost; rest without contact ends it. It remembers the time at rest [s]."""
        period = 1 / self.cell.world.settings.control_rate
        calm = (figure[FORCE] == 0) & (figure[SPEED] < REST_SPEED)
        rested = (memory + period) * calm
        over = rested >= REST_TIME - 1e-9
        price = FORCE_PRICE * figure[RATIO] + SPEED_PRICE * figure[SPEED]
        return REST_PRIZE * over - period * price, over, over, rested


def home_tool(world: World) -> Array:
    """Where the tool is at home [m], shape (3,)."""
    data = mujoco.MjData(world.scene.model)
    data.qpos[world.scene.qpos_adr] = world.scene.home
    mujoco.mj_kinematics(world.scene.model, data)
    return tool_position(world, data)


def _bare_tool(bare: Scene, data: mujoco.MjData) -> Array:
    site, body, _ = find_tools(bare, 1)[0]
    return np.array(data.site_xpos[site] if site >= 0 else data.xpos[body])


class ReactEnv(ArmEnv):
    """A swinging tool has struck a body region: choose what the arm does next.

    An episode begins at the first touch, or with ``detector=`` at its alarm (at the latest 0.1 s
    after the touch); with ``approach=False`` it begins before the swing. A trained detector settles
    first, while the arm stands. ``speed`` is that of the
    tool at the blow [m/s], give or take 20 %.

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


class ReactVectorEnv(VectorArmEnv):
    """Many React-v0 at once; see :class:`ReactEnv`."""

    task_type = React
