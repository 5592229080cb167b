"""Plans of episodes, drawn from a seed: with collisions, without collisions, and for the demo."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tauguard.envs import CollisionPlan, Episode, PayloadPick
from tauguard.models import Mismatch, load_arm
from tauguard.traces import STRATA

#: Payloads of the dissertation's 15 training slices [g]: 0 in 3 slices, each other payload in 2.
TRAINING_PAYLOADS = (0, 0, 0, 782, 782, 1016, 1016, 1282, 1282, 2298, 2298, 2757, 2757, 4039, 4039)
#: Kinds of collisions, cycled: half are strikes, a quarter pulses, a quarter clamps.
KIND_CYCLE = ("strike", "pulse", "strike", "clamp")
#: No collision begins before this time [s], because a detector starts up first.
BEGIN = 3.0
#: Length of a collision's time slot, earliest onset within the slot, largest delay after this [s].
SLOT, OFFSET, SPREAD = 3.0, 0.9, 0.2
#: Shortest and longest clamp [s]; the duration is drawn between them.
CLAMP_SECONDS = (0.4, 0.8)


def collision_plans(
    rng: np.random.Generator,
    count: int,
    strata: Sequence[tuple[float, float]] = STRATA,
    kinds: Sequence[str] = KIND_CYCLE,
    links: Sequence[int] = (2, 3, 4, 5, 6),
    clamp_seconds: tuple[float, float] = CLAMP_SECONDS,
) -> tuple[CollisionPlan, ...]:
    """``count`` collisions, one per time slot, spread over kinds, links and strata.

    Args:
        rng: shuffles the combinations of kind, link and stratum.
        count: number of collisions.
        strata: ranges of severity (peak torque), cycled [N m].
        kinds: kinds of collisions, cycled.
        links: links that are struck, cycled, 1-based.
        clamp_seconds: shortest and longest clamp [s].
    """
    kind_of = rng.permutation([kinds[i % len(kinds)] for i in range(count)])
    link_of = rng.permutation([links[i % len(links)] for i in range(count)])
    levels = rng.permutation([i % len(strata) for i in range(count)])
    plans = []
    for i in range(count):
        kind = str(kind_of[i])
        plans.append(
            CollisionPlan(
                kind=kind,
                time=BEGIN + SLOT * i + OFFSET + float(rng.uniform(0, SPREAD)),
                link=int(link_of[i]),
                severity=strata[int(levels[i])],
                duration=float(
                    rng.uniform(*clamp_seconds) if kind == "clamp" else rng.uniform(0.03, 0.2)
                ),
                at_rest=kind != "clamp" and bool(rng.random() < 0.15),
            )
        )
    return tuple(plans)


def episode_seconds(collisions: int, begin: float = BEGIN) -> float:
    """Length of an episode with this number of collisions, each in a slot of ``SLOT`` [s]."""
    return begin + SLOT * collisions + 0.5


def torque_scale(robot: str) -> float:
    """Factor on severities and loads for this robot, at most 1.

    It scales the lower end of the highest range of :data:`~tauguard.traces.STRATA` to at most the
    robot's largest torque limit.

    Raises:
        ValueError: a robot that cannot be used.
        FileNotFoundError: no such robot.
    """
    return min(1.0, float(load_arm(robot).torque_limit.max()) / STRATA[-1][0])


def pairing(i: int, speeds: Sequence[float], payloads: Sequence[float]) -> tuple[float, float]:
    """Speed and payload of episode ``i``: both lists are cycled, and every pair occurs.

    If the two lengths have a common factor, the payloads shift by one each time the pairs would
    repeat. Without the shift a speed would always occur with the same payloads.
    """
    pairs = math.lcm(len(speeds), len(payloads))
    moved = i // pairs % math.gcd(len(speeds), len(payloads))
    return float(speeds[i % len(speeds)]), float(payloads[(i + moved) % len(payloads)])


def struck_episodes(
    seed: int,
    count: int,
    collisions: int,
    speeds: Sequence[float],
    payloads: Sequence[float] = (0.0,),
    mismatch: Mismatch | None = None,
    robot: str = "cura6",
) -> list[Episode]:
    """Episodes with ``collisions`` collisions each.

    Function :func:`pairing` combines speeds [%] and payloads [g]. Severities are multiplied by the
    robot's :func:`torque_scale`; payloads are not.

    Raises:
        ValueError: a robot that cannot be used.
        FileNotFoundError: no such robot.
    """
    joints, scale = len(load_arm(robot).joints), torque_scale(robot)
    links = range(min(2, joints), joints + 1)
    strata = [(scale * low, scale * high) for low, high in STRATA]

    def hits(rng: np.random.Generator) -> tuple[CollisionPlan, ...]:
        return collision_plans(rng, collisions, strata=strata, links=links)

    common = {"seconds": episode_seconds(collisions), "mismatch": mismatch, "arm": robot}
    return _episodes([seed, 1], count, speeds, payloads, hits, **common)


def free_episodes(
    seed: int,
    count: int,
    seconds: float,
    speeds: Sequence[float],
    payloads: Sequence[float] = (0.0,),
    mismatch: Mismatch | None = None,
    robot: str = "cura6",
) -> list[Episode]:
    """Collision-free episodes."""
    common = {"seconds": seconds, "mismatch": mismatch, "arm": robot}
    return _episodes([seed, 2], count, speeds, payloads, lambda rng: (), **common)


def _episodes(
    seed: list[int],
    count: int,
    speeds: Sequence[float],
    payloads: Sequence[float],
    collisions: Callable[[np.random.Generator], tuple[CollisionPlan, ...]],
    **common: Any,
) -> list[Episode]:
    """Episodes drawn from ``seed``; ``common`` are fields that are the same in all of them."""
    episodes = []
    for i, child in enumerate(np.random.SeedSequence(seed).spawn(count)):
        rng = np.random.default_rng(child)
        speed, payload = pairing(i, speeds, payloads)
        episodes.append(
            Episode(
                seed=int(rng.integers(2**62)),
                speed=speed,
                payload_g=payload,
                collisions=collisions(rng),
                temperature=float(rng.uniform(25, 45)),
                **common,
            )
        )
    return episodes


#: Joint speeds at which the demo is evaluated [% of the maximum].
SPEEDS = (10.0, 30.0, 60.0)
#: Joint speeds at which the demo is trained [% of the maximum].
TRAINING_SPEEDS = (10.0, 30.0, 60.0, 20.0, 45.0)


@dataclass(frozen=True)
class DemoPlan:
    """All episodes of a demo; they have one arm and different seeds."""

    train: list[Episode]
    judge_struck: list[Episode]  #: test episodes with collisions
    judge_free: list[Episode]  #: test episodes without collisions
    showcase: Episode  #: episode for the replay

    @property
    def seconds(self) -> float:
        """Simulated time of training and test episodes [s]."""
        return sum(e.seconds for e in (*self.train, *self.judge_struck, *self.judge_free))


def demo_plan(seed: int, robot: str = "cura6") -> DemoPlan:
    """Plan 75 collisions for training; 72 collisions and 10 collision-free minutes for the test.

    In the showcase nine collisions of all kinds occur, then the arm picks up a payload.
    """
    arm, scale = Mismatch(seed=seed), torque_scale(robot)
    base = 4 * seed
    loads = [scale * load for load in TRAINING_PAYLOADS]
    struck = struck_episodes(base, len(loads), 5, TRAINING_SPEEDS, loads, arm, robot)
    free = free_episodes(base, 20, 40.0, TRAINING_SPEEDS, loads[::2], arm, robot=robot)
    payloads = [scale * load for load in (0.0, 1016.0, 4039.0, 2298.0, 782.0)]
    show = struck_episodes(base + 3, 1, 9, (30.0,), (0.0,), arm, robot)[0]
    pick = PayloadPick(show.seconds + 1.0, scale * 1016.0)
    judge_struck = struck_episodes(base + 1, 9, 8, SPEEDS, payloads, arm, robot)
    judge_free = free_episodes(base + 2, 12, 50.0, SPEEDS, payloads[:4], arm, robot=robot)
    return DemoPlan(
        train=[*struck, *free],
        judge_struck=judge_struck,
        judge_free=judge_free,
        showcase=replace(show, seconds=show.seconds + 4.0, picks=(pick,)),
    )
