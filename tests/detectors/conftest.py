"""A small arm's worth of simulated traces, and a detector trained on them."""

import numpy as np
import pytest

from tauguard.datasets.plans import free_episodes, struck_episodes
from tauguard.detectors import ArmModel, RobotNumbers, SrqSvr
from tauguard.detectors.alarms.training import train
from tauguard.envs import simulate
from tauguard.models import Mismatch, cura6, cura6_drive, pin_model

ARM = Mismatch(seed=11)


@pytest.fixture(scope="session")
def robot():
    return RobotNumbers.from_pin(pin_model(cura6.arm_xml()))


@pytest.fixture(scope="session")
def drive_gain():
    return np.array(cura6_drive().gain)


@pytest.fixture(scope="session")
def training():
    episodes = free_episodes(5, 9, 30.0, (10.0, 30.0, 60.0), (0.0, 2000.0, 4000.0), ARM)
    episodes += struck_episodes(6, 4, 7, (10.0, 30.0, 60.0), (0.0, 2500.0), ARM)
    return [simulate(episode) for episode in episodes]


@pytest.fixture(scope="session")
def unseen():
    return [simulate(e) for e in struck_episodes(77, 2, 8, (20.0, 50.0), (1500.0, 3500.0), ARM)]


@pytest.fixture(scope="session")
def arm(robot, drive_gain):
    return ArmModel(robot, drive_gain)


@pytest.fixture(scope="session")
def alarm(made_once, request):
    """A trained detector with its threshold."""

    def trained():
        training, arm = request.getfixturevalue("training"), request.getfixturevalue("arm")
        return train(SrqSvr(windows=1200, mined=200), training, arm, 20.0, folds=1)

    return made_once("alarm", trained)
