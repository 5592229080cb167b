"""Simulated contacts of a twin, for the training of detectors of the real arm."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tauguard.datasets.arm_logs import simulated
from tauguard.datasets.plans import struck_episodes
from tauguard.detectors import ArmModel
from tauguard.detectors.calibration.arm_file import load_arm
from tauguard.envs import CollisionPlan, simulate
from tauguard.findings import ArgumentError
from tauguard.models import Mismatch
from tauguard.models.robot import Robot, bodies_file
from tauguard.traces.logs import Logs


@dataclass(frozen=True)
class TwinEpisodes:
    """Options of :func:`twin_contacts`."""

    episodes: int = 24  #: number of simulated episodes; the twin's model errors differ between them
    contacts: int = 6  #: per episode
    push_seconds: tuple[float, float] = (0.1, 1.2)  #: range of a push's duration [s]
    push_fraction: float = 0.5  #: of the planned strikes that are replaced by pushes
    standing_fraction: float = 0.5  #: of these pushes that occur while the arm stands
    speed_percents: tuple[float, ...] = (10.0, 30.0, 60.0)
    """Speeds of the episodes in turn, in percent of the joints' largest speeds."""


def twin_contacts(
    twin: str | Path, options: TwinEpisodes = TwinEpisodes()
) -> tuple[Logs, ArmModel]:
    """Simulate contacts of a twin: all kinds, with different model errors of the twin.

    Args:
        twin: the TOML file of :func:`tauguard.identify_twin`.
        options: number, length and speed of the episodes.

    Returns:
        The recordings, at the sample rate of the twin's logs, and the arm model of the twin, as
        ``contacts`` and ``arm`` of :func:`tauguard.train`.

    Raises:
        ArgumentError: not the file of a twin.
    """
    robot, arm = Robot.from_toml(twin), load_arm(bodies_file(Path(twin)))
    sensors = robot.drive.sensors
    if arm is None or sensors is None or sensors.left_over is None:
        raise ArgumentError(
            f"{twin}: not the file of a twin, as `tauguard.identify_twin` makes one"
        )
    traces = []
    for seed in range(options.episodes):
        errors = Mismatch(
            seed=seed, mass=0.02, com=0.002, inertia=0.05, gain=0.03, coulomb=0.1, viscous=0.1
        )
        speeds = options.speed_percents
        speed, rng = (speeds[seed % len(speeds)],), np.random.default_rng([seed, 7])
        for episode in struck_episodes(seed, 1, options.contacts, speed, (0.0,), errors, str(twin)):
            plans = tuple(_some_as_pushes(rng, plan, options) for plan in episode.collisions)
            traces.append(simulate(replace(episode, collisions=plans)))
    return simulated(traces), arm


def _some_as_pushes(
    rng: np.random.Generator, plan: CollisionPlan, options: TwinEpisodes
) -> CollisionPlan:
    kept = plan.kind == "strike" and rng.random() > options.push_fraction
    if plan.kind == "clamp" or kept:
        return plan
    standing = bool(rng.random() < options.standing_fraction)
    duration = float(rng.uniform(*options.push_seconds))
    return replace(plan, kind="pulse", duration=duration, at_rest=standing)
