"""A training set that is too small is named when it is trained on, with what is needed."""

import pytest

from tauguard.datasets import free_episodes, struck_episodes
from tauguard.detectors import make_detector
from tauguard.detectors.alarms.training import train
from tauguard.envs import simulate
from tauguard.findings import ArgumentError
from tauguard.models import Mismatch


def test_too_few_recordings_are_an_error_of_the_training():
    arm, speeds = Mismatch(seed=3), (10.0, 30.0)
    struck = [simulate(e) for e in struck_episodes(6, 1, 3, speeds, (0.0,), arm)]
    free = [simulate(e) for e in free_episodes(5, 2, 10.0, speeds, (0.0,), arm)]
    method = make_detector("moving-thresholds")
    said = r"cannot be used: it raises .* trained on 1 recordings, 0 of them without collisions"
    with pytest.raises(ArgumentError, match=said):
        train(method, struck)
    assert train(method, struck + free).threshold > 0
