"""Simulated arms with drawn masses, friction, temperatures and sample rates, as a user's logs."""

from __future__ import annotations

import numpy as np

from studies.small_detector import thinned
from tauguard.detectors import ArmModel, RobotNumbers
from tauguard.detectors.calibration.recording import Recording
from tauguard.envs import Episode, Simulation
from tauguard.models import Mismatch, cura6, load_arm, pin_model

#: Sample intervals [s]: 100 to 1000 Hz.
INTERVALS = (10e-3, 8e-3, 4e-3, 2e-3, 1e-3)
#: Length of one log [s].
SECONDS = 30.0


def drawn_arm(seed: int, count: int) -> tuple[ArmModel, dict[str, Recording]]:
    """What the user of a drawn arm believes, and collision-free logs of it by name.

    The file is up to 30 % wrong in masses, 3 cm in centres, 8 % in the gains.

    Args:
        seed: of everything; successive ones take the sizes and the sample rates in turn.
        count: of logs of :data:`SECONDS` each.
    """
    rng = np.random.default_rng([seed, 2])
    name = cura6.NAMES[seed % len(cura6.NAMES)]
    level = float(rng.uniform(0.3, 0.8))
    mismatch = Mismatch(
        seed, mass=0.3, com=0.03, inertia=0.3, gain=0.08, coulomb=level, viscous=level
    )
    recordings = {}
    for k in range(count):
        episode = Episode(
            seed=1000 * seed + k,
            seconds=SECONDS,
            speed=float(rng.uniform(10, 60)),
            mismatch=mismatch,
            temperature=float(rng.uniform(25, 40)),
            arm=name,
        )
        trace = Simulation(episode).run()
        recordings[f"log_{k}"] = Recording(thinned(trace, 1 / INTERVALS[seed % len(INTERVALS)]))
    robot = RobotNumbers.from_pin(pin_model(cura6.arm_xml(name)))
    return ArmModel(robot, load_arm(name).facts.drive.gain), recordings
