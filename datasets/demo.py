"""The demo's configuration: what is simulated to train, to judge and to show."""

from __future__ import annotations

from dataclasses import dataclass, replace

from tauguard.datasets.plans import TRAINING_PAYLOADS, free_episodes, struck_episodes, torque_share
from tauguard.envs import Episode, PayloadPick
from tauguard.models import Mismatch

#: Percent of the maximum joint speed that the demo is judged at.
SPEEDS = (10.0, 30.0, 60.0)
#: Percent of the maximum joint speed that it is trained at.
TRAINING_SPEEDS = (10.0, 30.0, 60.0, 20.0, 45.0)


@dataclass(frozen=True)
class DemoPlan:
    """Every episode of a demo; training, judging and showing share no seed, but one arm."""

    train: list[Episode]
    judge_struck: list[Episode]
    judge_free: list[Episode]
    showcase: Episode

    @property
    def seconds(self) -> float:
        """Simulated for training and judging [s]."""
        return sum(e.seconds for e in (*self.train, *self.judge_struck, *self.judge_free))


def demo_plan(seed: int, robot: str = "cura6") -> DemoPlan:
    """75 training collisions, 72 judged ones, 10 judged collision-free minutes and a showcase.

    The showcase is one run of the arm at work: nine collisions of all kinds, then a payload taken
    up without telling the observer.
    """
    arm, share = Mismatch(seed=seed), torque_share(robot)
    base = 4 * seed
    loads = [share * load for load in TRAINING_PAYLOADS]
    struck = struck_episodes(base, len(loads), 5, TRAINING_SPEEDS, loads, arm, robot)
    free = free_episodes(base, 20, 40.0, TRAINING_SPEEDS, loads[::2], arm, robot=robot)
    payloads = [share * load for load in (0.0, 1016.0, 4039.0, 2298.0, 782.0)]
    show = struck_episodes(base + 3, 1, 9, (30.0,), (0.0,), arm, robot)[0]
    pick = PayloadPick(show.seconds + 1.0, share * 1016.0)
    judge_struck = struck_episodes(base + 1, 9, 8, SPEEDS, payloads, arm, robot)
    judge_free = free_episodes(base + 2, 12, 50.0, SPEEDS, payloads[:4], arm, robot=robot)
    return DemoPlan(
        train=[*struck, *free],
        judge_struck=judge_struck,
        judge_free=judge_free,
        showcase=replace(show, seconds=show.seconds + 4.0, picks=(pick,)),
    )
