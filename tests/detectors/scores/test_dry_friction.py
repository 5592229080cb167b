"""An arm whose file has dry friction: nothing is left of it but at starts, and there much."""

import numpy as np
import pytest

from tauguard.detectors.calibration import nominal
from tauguard.detectors.events import free_rows
from tauguard.detectors.features.front_end import FrontEndSettings
from tauguard.detectors.scores.windowed import SrqSvr
from tauguard.envs import Episode, simulate
from tests.models.arms import random_arm

#: Of six joints with friction loss, and of seven without; nothing was chosen on them.
DRY_SEED, WET_SEED = 2, 1


def motion(folder, seed):
    path = folder / f"arm{seed}.xml"
    path.write_text(random_arm(seed))
    return [simulate(Episode(k, 12.0, 40.0, arm=str(path))) for k in range(2)]


@pytest.fixture(scope="module")
def dry(tmp_path_factory):
    return motion(tmp_path_factory.mktemp("dry"), DRY_SEED)


def test_friction_that_switches_at_once_is_known_from_the_file(dry, monkeypatch):
    """What free motion leaves of the joints' torques at most, with and without the knowledge."""
    largest = []
    for slopes in (nominal.DRY, ()):
        monkeypatch.setattr(nominal, "DRY", slopes)
        front = FrontEndSettings().fit(dry, nominal.nominal_arm(dry))
        free = [np.abs(front.estimate(t).unexplained[free_rows(t, 3.0)]) for t in dry]
        largest.append(np.quantile(np.concatenate(free), 0.999, axis=0))
    assert (largest[0] < 0.7 * largest[1])[:4].all()


def test_an_arm_without_it_is_believed_as_before(tmp_path):
    traces = motion(tmp_path, WET_SEED)
    assert nominal.nominal_arm(traces).friction.slopes == (0.05, 0.3)


def test_what_free_motion_seldom_exceeds_counts_one_at_most(dry):
    """Heavy tails widen the unit of the windows, joint by joint; others leave it as it is."""
    front = FrontEndSettings().fit(dry, nominal.nominal_arm(dry))
    detector = SrqSvr()
    found = detector.initial_scaling(dry, front)
    signal = np.concatenate([np.abs(front.scaled(t, found)[free_rows(t, 3.0)]) for t in dry])
    most = np.quantile(signal, 0.999, axis=0)
    wider = found.noise_model.weights[list(found.joints), 0] / front.arm.noise_model.weights[:4, 0]
    assert (wider > 1).any()
    np.testing.assert_allclose(most[wider > 1], np.arcsinh(1.0), rtol=1e-6)
    assert (most[wider == 1] <= np.arcsinh(1.0)).all()
    np.testing.assert_array_equal(found.noise_model.weights[4:], front.arm.noise_model.weights[4:])
