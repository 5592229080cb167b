"""Simulated arms: their training slices, collisions of fixed severity, and collision-free motion.

Every speed has as many collisions in each stratum of achieved peak |tau_ext| over joints 1-4, so
that many severe collisions cannot raise a result. Plans that found no target, or whose collision
fell into another stratum, are drawn again with another seed until the strata are full.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tauguard.datasets.plans import (
    BEGIN,
    KIND_CYCLE,
    TRAINING_PAYLOADS,
    collision_plans,
    episode_seconds,
    free_episodes,
    struck_episodes,
)
from tauguard.detectors.events import detection_window
from tauguard.envs import CollisionPlan, Episode, simulate
from tauguard.models import Mismatch
from tauguard.traces import STRATA, Collision, Trace

#: Percent of the maximum speed in the training slices.
TRAINING_SPEEDS = (10.0, 30.0, 60.0, 20.0, 45.0)
#: Speeds at which detectors are tested [% of the maximum].
SPEEDS = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0)
#: Payloads of the test motions [g], no training payloads and unknown to the detector.
PAYLOADS = (0.0, 500.0, 1500.0, 2000.0, 3000.0, 3500.0)
#: Contact force of a tested collision [N].
FORCES = (20.0, 200.0)
FAINT = ((0.5, 1.0), (1.0, 2.0), (2.0, 4.0))  #: strata below the evaluated ones [N m]
FAINT_FORCES = (2.0, 200.0)  #: contact force of a collision in such a stratum [N]
GROUP = 5  #: collisions per test episode
ROUNDS = 8  #: largest number of rounds in which plans are drawn

#: Streams of seeds: training, thresholds, test motions.
TRAIN, CALIBRATE, TEST = 11, 12, 13

Stratum = tuple[float, float]
Wish = tuple[str, Stratum]
#: Stands for the stratum of a collision that is in no stratum.
_NONE = (0.0, 0.0)


@dataclass(frozen=True)
class Conditions:
    """Conditions of simulated motions; the defaults are those of the study's first table."""

    payloads: tuple[float, ...] = PAYLOADS  #: payloads of the episodes, in turn [g]
    temperature: float | None = None  #: temperature of the gears [degC]; None: drawn from 25 to 45
    scale: float = 1.0  #: factor on the model errors of the arm
    robot: str = "cura6"  #: name or file of the robot
    joints: int = 6  #: number of joints
    share: float = 1.0  #: factor on payloads, torques and least forces of the CURA6-like arm

    def arm(self, seed: int) -> Mismatch:
        """The arm ``seed`` under these conditions."""
        plain = Mismatch(seed=seed)
        names = ("mass", "com", "inertia", "gain", "coulomb", "viscous", "ripple")
        return replace(plain, **{n: self.scale * getattr(plain, n) for n in names})

    def applied(self, episode: Episode) -> Episode:
        """``episode`` of this robot, at this temperature."""
        if self.temperature is not None:
            episode = replace(episode, temperature=self.temperature)
        return replace(
            episode,
            arm=self.robot,
            payload_g=self.share * episode.payload_g,
            collisions=tuple(self._planned(plan) for plan in episode.collisions),
        )

    def _planned(self, plan: CollisionPlan) -> CollisionPlan:
        return replace(
            plan,
            link=min(plan.link, self.joints),
            severity=plan.severity and self.torques(plan.severity),
            force=plan.force and self.forces(plan.force),
        )

    def torques(self, stratum: Stratum) -> Stratum:
        """``stratum`` scaled to the torques of this robot [N m]."""
        return self.share * stratum[0], self.share * stratum[1]

    def forces(self, span: tuple[float, float]) -> tuple[float, float]:
        """Lowest and highest peak contact force of this robot's collisions [N]."""
        return self.share * span[0], span[1]

    def simulated(self, episode: Episode) -> Trace:
        """``episode`` under these conditions."""
        return simulate(self.applied(episode))


@dataclass(frozen=True)
class Training:
    """Amount of training data of one arm's detectors."""

    slices: int = 15  #: slices with collisions, over the dissertation's payloads
    collisions: int = 5  #: collisions per slice
    free: int = 20  #: number of collision-free slices
    free_seconds: float = 40.0  #: duration of a collision-free slice [s]

    def traces(self, seed: int, arm: int, under: Conditions = Conditions()) -> list[Trace]:
        """The simulated training slices of one arm."""
        own, mismatch = stream(seed, TRAIN, arm), under.arm(arm)
        speeds, payloads = TRAINING_SPEEDS, TRAINING_PAYLOADS
        struck = struck_episodes(own, self.slices, self.collisions, speeds, payloads, mismatch)
        free = free_episodes(own, self.free, self.free_seconds, speeds, payloads[::2], mismatch)
        return [under.simulated(episode) for episode in [*struck, *free]]


def stream(seed: int, *key: int) -> int:
    """A seed for each purpose, so that test motions are never trained on."""
    return int(np.random.SeedSequence([seed, *key]).generate_state(1)[0])


@dataclass(frozen=True)
class Struck:
    """One test episode with collisions."""

    arm: int  #: seed of the arm's model errors
    trace: Trace
    kept: tuple[bool, ...]  #: which of the trace's collisions count, in their order


def wishes(per_stratum: int, strata: Sequence[Stratum] = STRATA) -> list[Wish]:
    """Kind and stratum of every collision wanted: half strikes, quarter pulses, quarter clamps."""
    count = per_stratum * len(strata)
    return [(KIND_CYCLE[i % len(KIND_CYCLE)], strata[i % len(strata)]) for i in range(count)]


def struck_pool(
    seed: int,
    speed: float,
    arms: Sequence[int],
    per_stratum: int,
    strata: Sequence[Stratum] = STRATA,
    forces: tuple[float, float] = FORCES,
    conditions: Conditions | None = None,
    first: int = 0,
) -> Iterator[Struck]:
    """Episodes until every stratum holds ``per_stratum`` collisions, or the rounds are used up.
    ``arms`` are mismatch seeds; episode ``first`` + k takes the next arm and payload in turn.
    ``strata`` are [low, high) of the achieved peak |tau_ext| over joints 1-4 [N m].
    """
    under = conditions or Conditions()
    missing = Counter(wishes(per_stratum, strata))
    number = first
    for round_ in range(ROUNDS):
        rng = np.random.default_rng([seed, round(100 * speed), 3, round_])
        wanted = [wish for wish in sorted(missing.elements())]
        wanted = [wanted[i] for i in rng.permutation(len(wanted))]
        for begin in range(0, len(wanted), GROUP):
            group = wanted[begin : begin + GROUP]
            arm = arms[number % len(arms)]
            payload = under.payloads[(number // len(arms)) % len(under.payloads)]
            number += 1
            plans = _plans(rng, group, forces)
            episode = Episode(
                seed=int(rng.integers(2**62)),
                seconds=episode_seconds(len(plans)),
                speed=speed,
                payload_g=payload,
                collisions=plans,
                mismatch=under.arm(arm),
                temperature=float(rng.uniform(25, 45)),
            )
            trace = under.simulated(episode)
            assert trace.truth is not None
            kept = []
            for collision in trace.truth.collisions:
                own = {under.torques(stratum): stratum for stratum in strata}
                wish = (collision.kind, own.get(_stratum(collision, [*own]), _NONE))
                good = missing[wish] > 0 and _counts(collision, trace, under.forces(forces))
                missing[wish] -= int(good)
                kept.append(good)
            yield Struck(arm, trace, tuple(kept))
        if not sum(missing.values()):
            return


def _plans(
    rng: np.random.Generator, group: Sequence[Wish], forces: tuple[float, float]
) -> tuple[CollisionPlan, ...]:
    """The usual collision plans, but with the kinds and severities of ``group``."""
    changed = []
    for plan, (kind, stratum) in zip(collision_plans(rng, len(group)), group, strict=True):
        long = float(rng.uniform(0.4, 0.8) if kind == "clamp" else rng.uniform(0.03, 0.2))
        rest = kind != "clamp" and bool(rng.random() < 0.2)
        changed.append(
            replace(plan, kind=kind, severity=stratum, duration=long, at_rest=rest, force=forces)
        )
    return tuple(changed)


def _stratum(collision: Collision, strata: Sequence[Stratum]) -> Stratum:
    found = [s for s in strata if s[0] <= collision.peak_tau < s[1]]
    return found[0] if found else _NONE


def _counts(collision: Collision, trace: Trace, forces: tuple[float, float]) -> bool:
    """Whether the force is in range, and detectors have settled before the collision's window."""
    force = float(np.linalg.norm(collision.force))
    low, high = detection_window(collision)
    return forces[0] <= force <= forces[1] and low >= BEGIN and high <= trace.t[-1]


def free_pool(
    seed: int,
    speed: float,
    arms: Sequence[int],
    hours: float,
    conditions: Conditions | None = None,
    seconds: float = 60.0,
) -> list[tuple[int, Episode]]:
    """Arms and episodes of at least ``hours`` of collision-free test motion at one speed.

    The first seconds of an episode, in which detectors settle, come on top.
    """
    under = conditions or Conditions()
    count = max(len(arms), int(np.ceil(hours * 3600 / (seconds - BEGIN) - 1e-9)))
    pool = []
    for k, arm in enumerate(arms):
        share = len(range(k, count, len(arms)))
        own = np.random.SeedSequence([seed, round(100 * speed), arm]).generate_state(1)[0]
        episodes = free_episodes(int(own), share, seconds, (speed,), under.payloads, under.arm(arm))
        pool += [(arm, under.applied(episode)) for episode in episodes]
    return pool
