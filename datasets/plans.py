"""What to simulate: training slices, judged collisions and collision-free pools, from one seed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tauguard.envs import CollisionPlan, Episode, PayloadPick
from tauguard.models import Mismatch, load_arm
from tauguard.traces import STRATA

#: Payloads of the dissertation's 15 training slices [g]: 3 without, 2 of each of six.
TRAINING_PAYLOADS = (0, 0, 0, 782, 782, 1016, 1016, 1282, 1282, 2298, 2298, 2757, 2757, 4039, 4039)
#: Half strikes, a quarter pulses, a quarter clamps.
KIND_CYCLE = ("strike", "pulse", "strike", "clamp")
#: A detector settles in the first seconds of a run: no collision before [s].
BEGIN = 3.0
#: Seconds that one collision gets, and where in them it begins.
SLOT, OFFSET = 3.0, 0.9


def collision_plans(
    rng: np.random.Generator,
    count: int,
    begin: float = BEGIN,
    strata: Sequence[tuple[float, float]] = STRATA,
    kinds: Sequence[str] = KIND_CYCLE,
    links: Sequence[int] = (2, 3, 4, 5, 6),
) -> tuple[CollisionPlan, ...]:
    """``count`` collisions, one a slot, spread over kinds, links and strata.

    Args:
        rng: shuffles which kind meets which link and stratum.
        count: how many.
        begin: start of the first slot [s].
        strata: severities to go through in turn [N m].
        kinds: to go through in turn.
        links: to go through in turn, 1-based.
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
                time=begin + SLOT * i + OFFSET + float(rng.uniform(0, 0.2)),
                link=int(link_of[i]),
                severity=strata[int(levels[i])],
                duration=float(
                    rng.uniform(0.4, 0.8) if kind == "clamp" else rng.uniform(0.03, 0.2)
                ),
                at_rest=kind != "clamp" and bool(rng.random() < 0.15),
            )
        )
    return tuple(plans)


def episode_seconds(collisions: int, begin: float = BEGIN) -> float:
    """Length of an episode that holds ``collisions`` slots [s]."""
    return begin + SLOT * collisions + 0.5


def torque_share(robot: str) -> float:
    """What severities and loads are multiplied by on this robot, at most 1.

    With 1 the hardest severities of :data:`~tauguard.traces.STRATA` begin below the robot's largest
    torque limit.

    Raises:
        ValueError: a robot that cannot be used.
        FileNotFoundError: no such robot.
    """
    return min(1.0, float(load_arm(robot).torque_limit.max()) / STRATA[-1][0])


def pairing(i: int, speeds: Sequence[float], payloads: Sequence[float]) -> tuple[float, float]:
    """Speed and payload of episode ``i``: both are gone through in turn, and every pair comes.

    Where the two lengths have a common factor the payloads move on by one each time the pairs
    would repeat; otherwise a speed would always carry the same payloads.
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
    """Episodes with ``collisions`` each; speeds [%] and payloads [g] as :func:`pairing` has it.

    The collisions' severities are those of the robot's :func:`torque_share`, its payloads as given.

    Raises:
        ValueError: a robot that cannot be used.
        FileNotFoundError: no such robot.
    """
    joints, share = len(load_arm(robot).joints), torque_share(robot)
    links = range(min(2, joints), joints + 1)
    strata = [(share * low, share * high) for low, high in STRATA]
    children = np.random.SeedSequence([seed, 1]).spawn(count)
    episodes = []
    for i, child in enumerate(children):
        rng = np.random.default_rng(child)
        speed, payload = pairing(i, speeds, payloads)
        episodes.append(
            Episode(
                seed=int(rng.integers(2**62)),
                seconds=episode_seconds(collisions),
                speed=speed,
                payload_g=payload,
                collisions=collision_plans(rng, collisions, strata=strata, links=links),
                mismatch=mismatch,
                temperature=float(rng.uniform(25, 45)),
                arm=robot,
            )
        )
    return episodes


def free_episodes(
    seed: int,
    count: int,
    seconds: float,
    speeds: Sequence[float],
    payloads: Sequence[float] = (0.0,),
    mismatch: Mismatch | None = None,
    picks: bool = False,
    robot: str = "cura6",
) -> list[Episode]:
    """Collision-free episodes; with ``picks`` a payload is taken up half-way through each."""
    children = np.random.SeedSequence([seed, 2]).spawn(count)
    episodes = []
    for i, child in enumerate(children):
        rng = np.random.default_rng(child)
        speed, payload = pairing(i, speeds, payloads)
        episode = Episode(
            seed=int(rng.integers(2**62)),
            seconds=seconds,
            speed=speed,
            payload_g=payload,
            mismatch=mismatch,
            temperature=float(rng.uniform(25, 45)),
            arm=robot,
        )
        if picks and payload:
            change = PayloadPick(seconds / 2, payload)
            episode = replace(episode, payload_g=0.0, picks=(change,))
        episodes.append(episode)
    return episodes
