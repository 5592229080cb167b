"""The fault study on a small simulated arm."""

import numpy as np
import pytest

from studies.faults.arms import RATE, ArmLogs
from studies.faults.study import Tally, clean, moments
from studies.small_detector import trained
from tauguard.datasets.plans import free_episodes, struck_episodes
from tauguard.envs import simulate
from tauguard.models import Mismatch


@pytest.fixture(scope="module")
def tested():
    drawn = Mismatch(seed=4)
    free = [simulate(e) for e in free_episodes(9, 3, 8.0, (40.0,), (0.0,), drawn)]
    alarm = trained(free, RATE, 5.0, "residual-thresholds")
    return ArmLogs.struck("small", alarm, struck_episodes(2, 1, 3, (40.0,), (0.0,), drawn))


def test_a_log_without_a_fault_has_none_and_the_alarms_of_detect(tested):
    row = clean(tested, "struck_0", tested.logs["struck_0"])
    assert row["false_fault_s"] == 0
    assert row["alarms"] == row["alarms_of_detect"] > 0


@pytest.mark.parametrize("name", ["nan", "frozen", "missing", "late"])
def test_a_fault_is_seen_and_leaves_nothing_untold(tested, name):
    tally = Tally()
    chosen = moments(tested, np.random.default_rng(1), 2)
    assert 2 <= len(chosen) <= 4  # two at random, and what collisions there are
    for log, start in chosen:
        tally.add(tested, log, name, start)
    row = tally.row("small", name)
    assert row["seen"]["value"] == 1
    # The last samples of a burst are no more than 20 ms old, and all come at one moment.
    assert row["silent_s"] <= (0.002 * len(chosen) + 1e-9 if name == "late" else 0)
    assert row["false_alarms"] == 0
    assert row["longest_ms"] <= 20.001
    assert row["missed"] == 0 <= row["of_struck"]
    assert row["found_after"]["value"] in (None, 1)


def test_the_moments_follow_from_the_seed(tested):
    one, two = (moments(tested, np.random.default_rng(3), 3) for _ in range(2))
    assert [start for _, start in one] == [start for _, start in two]


def test_a_fault_that_is_never_seen_can_be_written_and_drawn():
    import json

    from matplotlib.figure import Figure

    from studies.faults.study import draw

    row = Tally(moments=3).row("small", "bias")
    assert "NaN" not in json.dumps(row, allow_nan=False)
    draw([row], Figure())
