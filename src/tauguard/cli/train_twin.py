"""``tauguard train --twin``: a detector trained on a twin's contacts and the arm's free logs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from tauguard.findings import ArgumentError

if TYPE_CHECKING:
    from tauguard.datasets.columns import Reading
    from tauguard.traces import Trace

STRUCK = 24  #: number of simulated episodes; the twin's model errors differ between them
CONTACTS = 6  #: contacts per episode
PUSH = (0.1, 1.2)  #: range of a push's duration [s]
PUSHED = 0.5  #: fraction of the planned strikes that are replaced by pushes
STANDING = 0.5  #: fraction of these pushes that occur while the arm stands
#: Speeds of the episodes in turn, in percent of the joints' largest speeds.
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
    """Train a detector on simulated contacts and free logs; it runs together with ``free-motion``.

    Args:
        twin: description that `tauguard twin` wrote.
        free: collision-free logs of the same arm, without a load.
        model: file to write.
        columns: columns of the logs.
        detector: one of ``tauguard.detectors.DETECTORS``.
        per_hour: accepted false alarms per hour of motion like that of the logs.
        torque: the logs hold joint torques.
        reading: how logs are read.

    Raises:
        ArgumentError: ``twin`` is not a twin's file, or the logs have another rate or arm.
    """
    from tauguard.cli.free_logs import read_real
    from tauguard.cli.help_text import print_notes
    from tauguard.detectors import CollisionAlarm, make_detector, save_model
    from tauguard.detectors.alarms.beside_free_motion import BesideFreeMotion
    from tauguard.detectors.alarms.training import train_beside
    from tauguard.detectors.calibration.arm_file import load_arm
    from tauguard.detectors.faults.inputs import UsualInput
    from tauguard.detectors.samples import same_rate
    from tauguard.detectors.scores.free_motion import CONFIRMATION, FreeMotion
    from tauguard.detectors.thresholds.expected_rate import ExpectedRate
    from tauguard.models.robot import Robot, bodies_file

    robot = Robot.from_toml(twin)
    arm = load_arm(bodies_file(twin))
    sensors = robot.drive.sensors
    if arm is None or sensors is None or sensors.left_over is None:
        raise ArgumentError(f"--twin {twin}: not a file that `tauguard twin` wrote")
    method = make_detector(detector)
    read = read_real(free, bodies_file(twin), columns, (), torque, reading)
    print_notes(read.findings)
    traces = {name: log.trace for name, log in read.items()}
    for name, trace in traces.items():
        if not same_rate(trace.dt, 1 / sensors.rate):
            raise ArgumentError(
                f"{name}: {1 / trace.dt:.4g} samples a second, the twin has "
                f"{sensors.rate:.4g}; expected logs of that rate, or --resample {sensors.rate:.4g}"
            )
    names, logs = arm.robot.joint_names, read.traces
    struck = [replace(trace, joint_names=names) for trace in contacts(twin)]
    learned, scores, notes = train_beside(method, struck, traces, arm, per_hour)
    quiet = FreeMotion().fit(logs, arm)
    both = BesideFreeMotion(quiet, learned)
    usual = UsualInput.of(logs, quiet.arm)
    save_model(CollisionAlarm(both, 1.0, CONFIRMATION, inputs=usual), model, twin)
    count = sum(len(trace.truth.collisions) for trace in struck if trace.truth)
    print(
        f"{model}: {both.name}, trained on {len(logs)} logs and {count} contacts of the twin; the "
        f"learned score's threshold is {learned.threshold:.3g}"
    )
    print(f"{detector}: {ExpectedRate.of(scores).at(learned.threshold, per_hour)}")
    print_notes(notes)


def contacts(twin: Path) -> list[Trace]:
    """Simulated episodes with all kinds of contacts and with different model errors of the twin."""
    import numpy as np

    from tauguard.datasets import struck_episodes
    from tauguard.envs import CollisionPlan, simulate
    from tauguard.models import Mismatch

    def some_as_pushes(rng: np.random.Generator, plan: CollisionPlan) -> CollisionPlan:
        if plan.kind == "clamp" or (plan.kind == "strike" and rng.random() > PUSHED):
            return plan
        standing = bool(rng.random() < STANDING)
        return replace(plan, kind="pulse", duration=float(rng.uniform(*PUSH)), at_rest=standing)

    found = []
    for seed in range(STRUCK):
        one = Mismatch(
            seed=seed, mass=0.02, com=0.002, inertia=0.05, gain=0.03, coulomb=0.1, viscous=0.1
        )
        speed, rng = (SPEEDS[seed % len(SPEEDS)],), np.random.default_rng([seed, 7])
        for episode in struck_episodes(seed, 1, CONTACTS, speed, (0.0,), one, str(twin)):
            plans = tuple(some_as_pushes(rng, plan) for plan in episode.collisions)
            found.append(simulate(replace(episode, collisions=plans)))
    return found
