"""``tauguard train --twin``: contacts learned on a twin, quietness on the arm's own free logs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tauguard.datasets.columns import Reading
    from tauguard.traces import Trace

#: Episodes with contacts, contacts in each, and episodes without; each is another individual.
STRUCK, CONTACTS, FREE = 18, 6, 3
#: Percent of the joints' largest speeds, in turn.
SPEEDS = (10.0, 30.0, 60.0)


def twin_contacts(
    twin: Path,
    free: tuple[Path, ...],
    model: Path,
    columns: str | None,
    detector: str,
    per_hour: float,
    torque: bool,
    reading: Reading | None = None,
) -> None:
    """Train on simulated contacts and real free logs; print what the threshold aims at.

    Args:
        twin: description that `tauguard twin` wrote.
        free: collision-free logs of the same arm, without a load.
        model: file to write.
        columns: of the logs.
        detector: one of ``tauguard.detectors.DETECTORS``.
        per_hour: false alarms to accept in an hour of motion like the logs'.
        torque: the logs hold joint torques.
        reading: how logs are read.

    Raises:
        ValueError: no twin, or logs of another rate or arm.
    """
    from tauguard.cli.help_text import print_notes
    from tauguard.cli.train import aimed_at
    from tauguard.datasets.arm_logs import read_logs
    from tauguard.detectors import make_detector, save_model
    from tauguard.detectors.alarms.training import train_and_score
    from tauguard.detectors.calibration.arm_file import load_arm
    from tauguard.detectors.samples import same_rate
    from tauguard.models.robot import Robot, bodies_file

    robot = Robot.from_toml(twin)
    arm = load_arm(bodies_file(twin))
    sensors = robot.drive.sensors
    if arm is None or sensors is None or sensors.left_over is None:
        raise ValueError(f"--twin {twin}: not a file that `tauguard twin` wrote")
    method = make_detector(detector)
    read = read_logs(free, columns, bodies_file(twin), torque, reading)
    print_notes(read.notes)
    for name, trace in read.traces.items():
        if not same_rate(trace.dt, 1 / sensors.rate):
            raise ValueError(
                f"{name}: {1 / trace.dt:.4g} samples a second, the twin has {sensors.rate:.4g}"
            )
    names = arm.robot.joint_names
    struck = [replace(trace, joint_names=names) for trace in contacts(twin)]
    alarm, scores = train_and_score(method, [*struck, *read.traces.values()], arm, per_hour, 1)
    save_model(alarm, model)
    count = sum(len(trace.truth.collisions) for trace in struck if trace.truth)
    print(
        f"{model}: {detector} trained on {count} contacts of the twin and {len(read.traces)} logs, "
        f"threshold {alarm.threshold:.3g}"
    )
    print(aimed_at(alarm, scores, per_hour))


def contacts(twin: Path) -> list[Trace]:
    """Simulated runs of individuals of the twin, with contacts and without."""
    from tauguard.datasets import free_episodes, struck_episodes
    from tauguard.envs import simulate
    from tauguard.models import Mismatch

    episodes = []
    for seed in range(STRUCK + FREE):
        one = Mismatch(
            seed=seed, mass=0.02, com=0.002, inertia=0.05, gain=0.03, coulomb=0.1, viscous=0.1
        )
        speed = (SPEEDS[seed % len(SPEEDS)],)
        episodes += (
            struck_episodes(seed, 1, CONTACTS, speed, (0.0,), one, str(twin))
            if seed < STRUCK
            else free_episodes(seed, 1, 15.0, speed, (0.0,), one, robot=str(twin))
        )
    return [simulate(episode) for episode in episodes]
