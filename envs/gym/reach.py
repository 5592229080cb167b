"""Reach-v0: bring the tool to one place after another while body regions cross the path."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import mujoco
import numpy as np

from tauguard.arrays import Array
from tauguard.envs.gym.base import ArmEnv
from tauguard.envs.gym.batch import Batch, StepMetrics
from tauguard.envs.gym.compiled import LOWEST, NEAREST, SHORT, pose_box, tool_position
from tauguard.envs.gym.task import Outcome, Task
from tauguard.envs.gym.vector import VectorArmEnv

TOLERANCE = 0.03  #: distance at which a target counts as reached [m]
BONUS = 1.0  #: reward for a reached target
#: One second of contact at this force or more costs as much reward as a target gives [N].
CONTACT_FORCE = 100.0
#: Largest distance of each joint's initial position from home [rad].
START_SPREAD = 0.1
CANDIDATES = 6  #: number of candidates for the next target
#: Probability that the next target is the candidate whose straight path passes closest to the
#: person. With the same probability the person's hand moves onto the path.
NEAR_PERSON = 0.5
#: The hand moves to a place between these fractions of the path.
HAND_FRACTION = (0.4, 1.0)
HAND_DEVIATION = 0.03  #: standard deviation of that place [m]
HAND_STAYS = 0.6  #: time for which the hand stays there [s]
#: Least distance of a target from the tool [m].
APART = 0.1
#: Tolerance, and least distance of a target from the tool, for a short arm [reach].
SHORT_TOLERANCE, SHORT_APART = 0.1, 0.33


class Reach(Task):
    """The reward is the decrease of the distance [m], and 1 for each target that is reached."""

    defaults: ClassVar[dict[str, Any]] = {"obstacles": ("person",)}
    terms: ClassVar[tuple[str, ...]] = ("progress", "target")

    def __init__(self, batch: Batch, **options: Any) -> None:
        """Prepare to draw targets."""
        super().__init__(batch)
        self._scratch = mujoco.MjData(batch.compiled.scene.model)
        low, high = pose_box(batch.compiled.scene)
        each = len(low) // self.arms
        parts = [slice(arm * each, (arm + 1) * each) for arm in range(self.arms)]
        #: For each arm: addresses of its joints in qpos, and the box from which poses are drawn.
        self._poses = [(batch.compiled.scene.qpos_adr[p], low[p], high[p]) for p in parts]
        model = batch.compiled.scene.model
        #: For each region (None: held): addresses in qpos and qvel, span [m], speed [m/s].
        self._crossings = [
            (int(model.jnt_qposadr[r.joint]), int(model.jnt_dofadr[r.joint]), r.span, r.speed)
            if r.joint >= 0
            else None
            for r in batch.compiled.regions
        ]
        base = batch.compiled.scene.model.joint(batch.compiled.scene.joint_names[0]).id
        mujoco.mj_forward(batch.compiled.scene.model, self._scratch)
        self._base: list[float] = self._scratch.xanchor[base].tolist()
        layout = batch.compiled.layout
        height, away = (f * layout.reach for f in SHORT)
        self._lowest = layout.base[2] + min(LOWEST, height)
        self._nearest = min(NEAREST, away)
        self._apart = min(APART, SHORT_APART * layout.reach)
        #: Distance at which a target counts as reached [m].
        self.tolerance = min(TOLERANCE, SHORT_TOLERANCE * layout.reach)

    def start(self, i: int, rng: np.random.Generator) -> None:
        """Start near home, with regions anywhere on their lines and new targets."""
        batch = self.batch
        home = batch.compiled.scene.home
        batch.place(i, home + rng.uniform(-START_SPREAD, START_SPREAD, len(home)))
        self.send_regions(i, rng)
        batch.send_people(i, rng)
        batch.start(i)
        for arm in range(batch.compiled.arms):
            batch.target[i, arm] = self.draw(i, rng, arm, None)
        if batch.compiled.person is not None:
            self.aim_near_person(i, rng, None)
        batch.plants[i].refresh()
        self.memory[i] = batch.metrics["distance"][i]

    def send_regions(self, i: int, rng: np.random.Generator) -> None:
        """Start each region in the outer half of its line; it moves to the middle at its speed."""
        data = self.batch.datas[i]
        qpos, qvel = data.qpos, data.qvel
        for crossing in self._crossings:
            side, place = 2.0 * int(rng.integers(2)) - 1.0, rng.uniform(0.5, 1.0)
            if crossing is not None:
                at, moves, span, speed = crossing
                qpos[at], qvel[moves] = side * place * span, -side * speed

    def draw(self, i: int, rng: np.random.Generator, arm: int, apart: Array | None) -> Array:
        """Draw a place [m] that the tool can reach, not too near to ``apart``."""
        compiled, scratch = self.batch.compiled, self._scratch
        (adr, low, high), (bx, by, _) = self._poses[arm], self._base
        place = np.zeros(3)
        for _ in range(100):
            scratch.qpos[adr] = rng.uniform(low, high)
            mujoco.mj_kinematics(compiled.scene.model, scratch)
            place = tool_position(compiled, scratch, arm)
            x, y, z = place.tolist()
            near = arm == 0 and math.hypot(x - bx, y - by) < self._nearest
            still = apart is not None and np.linalg.norm(place - apart) < self._apart
            if z >= self._lowest and not near and not still and self.suits(i, arm, place):
                break
        return place

    def suits(self, i: int, arm: int, place: Array) -> bool:
        """Whether a reachable place may be the target of an arm in this task."""
        return True

    def aim_near_person(self, i: int, rng: np.random.Generator, apart: Array | None) -> None:
        """Draw whether the path passes near the person, and whether a hand moves onto it."""
        batch, data = self.batch, self.batch.datas[i]
        tool = tool_position(batch.compiled, data)
        behind, reaches = rng.random(2) < NEAR_PERSON
        if behind:
            bodies = [r.body for r in batch.compiled.regions if r.mocap >= 0]
            places = [self.draw(i, rng, 0, apart) for _ in range(CANDIDATES)]
            nearest = [_clearance(tool, place, data.xpos[bodies]) for place in places]
            batch.target[i, 0] = places[int(np.argmin(nearest))]
        place = tool + rng.uniform(*HAND_FRACTION) * (batch.target[i, 0] - tool)
        place += rng.normal(0.0, HAND_DEVIATION, 3)
        if reaches:
            batch.plants[i].aim(place, HAND_STAYS)

    def score(self, step: StepMetrics, memory: Any) -> Outcome:
        """Progress and bonus; the task never ends. ``memory`` is the last distance [m]."""
        reached = step.distance < self.tolerance
        rewards = {"progress": memory - step.distance, "target": BONUS * reached}
        return Outcome(rewards, reached, step.distance)

    def after(self, i: int, rng: np.random.Generator) -> None:
        """Draw the next target of each arm."""
        batch = self.batch
        for arm in range(batch.compiled.arms):
            batch.target[i, arm] = self.draw(i, rng, arm, batch.target[i, arm].copy())
        if batch.compiled.person is not None:
            self.aim_near_person(i, rng, batch.target[i, 0].copy())
        batch.plants[i].refresh()
        self.memory[i] = batch.metrics["distance"][i]


class CarefulReach(Reach):
    """Reach with a cost of contacts: the peak force of each action times its duration."""

    terms: ClassVar[tuple[str, ...]] = (*Reach.terms, "contact")

    def score(self, step: StepMetrics, memory: Any) -> Outcome:
        """As :class:`Reach`, minus force / :data:`CONTACT_FORCE` (at most 1) per second."""
        outcome = super().score(step, memory)
        period = 1 / self.batch.compiled.settings.control_rate
        hard = step.force / CONTACT_FORCE
        outcome.rewards["contact"] = -period * (hard - (hard - 1.0) * (hard > 1.0))
        return outcome


def _clearance(begin: Array, end: Array, points: Array) -> float:
    """Least distance of points (m, 3) from the segment from ``begin`` to ``end`` [m]."""
    path = end - begin
    fraction = np.clip((points - begin) @ path / max(float(path @ path), 1e-12), 0.0, 1.0)
    return float(np.linalg.norm(begin + fraction[:, None] * path - points, axis=1).min())


class ReachEnv(ArmEnv):
    """Bring the tool to places beside a person who works, reaches into the path and walks.

    For half of the targets the straight path passes close to the person. For half of the targets
    the person's hand moves onto the path. A policy that ignores people therefore hits them. With
    ``obstacles=("hand",)`` only a hand crosses the workspace, and there is no person.

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
    | "cartesian" | 6 | motion of the tool in one step: 0.5 m/s along, 1.5 rad/s about x, y, z |

    ``unwrapped.batch.actions`` and ``unwrapped.batch.observations`` list the entries with numbers.

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

    The reward is how much nearer the tool came [m], plus 1 when it is within 3 cm of the target.
    Then the next target appears. An episode has 1000 steps. ``info["cost"]`` is the impulse on
    people beyond the limits [N s].
    """

    task_type = Reach


class ReachVectorEnv(VectorArmEnv):
    """Several copies of Reach-v0; see :class:`ReachEnv`."""

    task_type = Reach
