"""Reach-v0: bring the tool to one place after another while body regions cross the path."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, ClassVar

import mujoco
import numpy as np

from tauguard.arrays import Array
from tauguard.envs.gym.base import ArmEnv, Task
from tauguard.envs.gym.cell import DISTANCE, Cell
from tauguard.envs.gym.vector import VectorArmEnv
from tauguard.envs.gym.world import LOWEST, NEAREST, pose_box, tool_position

#: A target counts as reached this near [m], and is worth this much reward.
TOLERANCE, BONUS = 0.03, 1.0
#: An episode starts this near to home [rad].
START_SPREAD = 0.1
#: With a person: this share of targets is the one of so many whose straight way passes nearest to
#: them, and as often their hand reaches for that way: to a place in its outer part, give or take
#: [m], where it stays [s].
TEMPTED, CANDIDATES = 0.5, 6
OUTER, GIVE_OR_TAKE, STAYS = (0.4, 1.0), 0.03, 0.6
#: A target is at least this far from where the tool is [m].
APART = 0.1


class Reach(Task):
    """Reward: how much nearer the tool came [m], and 1 for a target; then comes the next one."""

    defaults: ClassVar[dict[str, Any]] = {"obstacles": ("person",)}

    def __init__(self, cell: Cell, **options: Any) -> None:
        """Prepare drawing targets."""
        super().__init__(cell)
        self._scratch = mujoco.MjData(cell.world.scene.model)
        low, high = pose_box(cell.world.scene)
        each = len(low) // self.arms
        parts = [slice(arm * each, (arm + 1) * each) for arm in range(self.arms)]
        #: An arm each: where its joints are in qpos, and the box of poses to draw from.
        self._poses = [(cell.world.scene.qpos_adr[p], low[p], high[p]) for p in parts]
        model = cell.world.scene.model
        #: A moving region each: addresses in qpos and qvel, span [m], speed [m/s].
        self._ways = [
            (int(model.jnt_qposadr[r.joint]), int(model.jnt_dofadr[r.joint]), r.span, r.speed)
            if r.joint >= 0
            else None
            for r in cell.world.regions
        ]
        base = cell.world.scene.model.joint(cell.world.scene.joint_names[0]).id
        mujoco.mj_forward(cell.world.scene.model, self._scratch)
        self._base: list[float] = self._scratch.xanchor[base].tolist()

    def start(self, i: int, rng: np.random.Generator) -> None:
        """Near home, regions anywhere on their lines, a new target."""
        cell = self.cell
        home = cell.world.scene.home
        cell.place(i, home + rng.uniform(-START_SPREAD, START_SPREAD, len(home)))
        self.send_regions(i, rng)
        cell.send_person(i, rng)
        cell.start(i)
        for arm in range(cell.world.arms):
            cell.target[i, arm] = self.draw(rng, arm, None)
        if cell.world.person is not None:
            self.tempt(i, rng, None)
        cell.plants[i].refresh()
        self.memory[i] = cell.figure[i, DISTANCE]

    def send_regions(self, i: int, rng: np.random.Generator) -> None:
        """Each at its speed towards the middle of its line, from its outer part."""
        data = self.cell.datas[i]
        qpos, qvel = data.qpos, data.qvel
        for way in self._ways:
            side, place = 2.0 * int(rng.integers(2)) - 1.0, rng.uniform(0.5, 1.0)
            if way is not None:
                at, moves, span, speed = way
                qpos[at], qvel[moves] = side * place * span, -side * speed

    def draw(self, rng: np.random.Generator, arm: int, apart: Array | None) -> Array:
        """A place [m] that the tool can reach, at least :data:`APART` from ``apart``."""
        world, scratch = self.cell.world, self._scratch
        (adr, low, high), (bx, by, _) = self._poses[arm], self._base
        place = np.zeros(3)
        for _ in range(100):
            scratch.qpos[adr] = rng.uniform(low, high)
            mujoco.mj_kinematics(world.scene.model, scratch)
            place = tool_position(world, scratch, arm)
            x, y, z = place.tolist()
            near = arm == 0 and math.hypot(x - bx, y - by) < NEAREST
            still = apart is not None and np.linalg.norm(place - apart) < APART
            if z >= LOWEST and not near and not still:
                break
        return place

    def tempt(self, i: int, rng: np.random.Generator, apart: Array | None) -> None:
        """A target beyond the person, or their hand in the way to it: the first arm's."""
        cell, data = self.cell, self.cell.datas[i]
        tool = tool_position(cell.world, data)
        behind, reaches = rng.random(2) < TEMPTED
        if behind:
            bodies = [r.body for r in cell.world.regions if r.mocap >= 0]
            places = [self.draw(rng, 0, apart) for _ in range(CANDIDATES)]
            nearest = [_clearance(tool, place, data.xpos[bodies]) for place in places]
            cell.target[i, 0] = places[int(np.argmin(nearest))]
        way = tool + rng.uniform(*OUTER) * (cell.target[i, 0] - tool)
        goal = way + rng.normal(0.0, GIVE_OR_TAKE, 3)
        if reaches:
            cell.plants[i].aim(goal, STAYS)

    def score(self, figure: Sequence[Any], memory: Any) -> tuple[Any, Any, Any, Any]:
        """Progress and bonus; never over by itself. The memory is the last distance [m]."""
        distance = figure[DISTANCE]
        reached = distance < TOLERANCE
        return memory - distance + BONUS * reached, distance < 0, reached, distance

    def after(self, i: int, rng: np.random.Generator) -> None:
        """The next target."""
        cell = self.cell
        for arm in range(cell.world.arms):
            cell.target[i, arm] = self.draw(rng, arm, cell.target[i, arm].copy())
        if cell.world.person is not None:
            self.tempt(i, rng, cell.target[i, 0].copy())
        cell.plants[i].refresh()
        self.memory[i] = cell.figure[i, DISTANCE]


def _clearance(begin: Array, end: Array, points: Array) -> float:
    """Least distance of points (m, 3) from the way from ``begin`` to ``end`` [m]."""
    way = end - begin
    share = np.clip((points - begin) @ way / max(float(way @ way), 1e-12), 0.0, 1.0)
    return float(np.linalg.norm(begin + share[:, None] * way - points, axis=1).min())


class ReachEnv(ArmEnv):
    """Bring the tool to places beside a person who works, reaches into the way and walks.

    Half of the targets lie where the way to them passes near the person, and half of the times the
    person's hand reaches for that way: who ignores people hits them. A single body region that
    crosses the workspace is ``obstacles=("hand",)``.

    ## Actions (joint velocity, the default; n joints)

    | index | name | range | meaning of 1 |
    |---|---|---|---|
    | 0 .. n-1 | velocity of joint i | -1 to 1 | the joint's largest speed [rad/s] |

    | ``control=`` | size | meaning of 1 |
    |---|---|---|
    | "current" | n | largest motor current [A]; nothing holds the arm up |
    | "torque" | n | largest torque [N m] on top of gravity compensation |
    | "joint_velocity" | n | largest speed [rad/s], servo-controlled |
    | "joint_position" | n | 2 rad from home or the end of its range, at largest speed |
    | "cartesian" | 6 | tool: 0.5 m/s along and 1.5 rad/s about x, y, z, a step's worth |

    ``unwrapped.cell.actions`` and ``unwrapped.cell.observations`` are these tables with numbers.

    ## Observations (n joints, k body regions; 3 n + 6 + 6 k numbers)

    | index | name | range | unit |
    |---|---|---|---|
    | 0 .. n-1 | position of joint i | its range and 0.5 beyond | rad |
    | n .. 2n-1 | velocity of joint i | -100 to 100 | rad/s |
    | 2n .. 3n-1 | motor torque of joint i, nominal gain times current | 1.5 times limit | N m |
    | 3n .. 3n+2 | position of the tool | -100 to 100 | m |
    | 3n+3 .. 3n+5 | target less tool | -100 to 100 | m |
    | 3n+6+6j .. +2 | position of region j | -100 to 100 | m |
    | 3n+9+6j .. +2 | velocity of region j | -100 to 100 | m/s |

    ## Reward, end and cost

    The reward is how much nearer the tool came [m], and 1 within 3 cm of the target; then the next
    target appears. An episode has 1000 steps. ``info["cost"]`` is the price of hitting somebody.
    """

    task_type = Reach


class ReachVectorEnv(VectorArmEnv):
    """Many Reach-v0 at once; see :class:`ReachEnv`."""

    task_type = Reach
