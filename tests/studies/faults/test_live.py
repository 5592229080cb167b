"""``tauguard bench listen`` on a few seconds of a small simulated arm."""

import multiprocessing

import numpy as np
import pytest
from matplotlib.figure import Figure

from studies.faults import live
from studies.small_detector import thinned, trained
from tauguard.datasets.plans import free_episodes, struck_episodes
from tauguard.detectors import save_model
from tauguard.envs import simulate
from tauguard.models import Mismatch
from tauguard.traces import Trace, write_mcap

RATE = 125.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder, drawn = tmp_path_factory.mktemp("live"), Mismatch(seed=4)
    free = [simulate(e) for e in free_episodes(9, 3, 6.0, (40.0,), (0.0,), drawn)]
    save_model(trained(free, RATE, 5.0, "residual-thresholds"), folder / "125.skops")
    log = thinned(simulate(struck_episodes(2, 1, 3, (40.0,), (0.0,), drawn)[0]), RATE)
    keep = log.t < log.t[0] + 4
    signals = (a[keep] for a in (log.t, log.q, log.qd, log.current))
    write_mcap(folder / "125.mcap", Trace(log.joint_names, *signals))
    return folder


def test_a_played_log_is_heard_whole_and_its_process_ends(folder):
    row = live.heard(folder, RATE)
    assert row["sent"] == row["heard"] == 500
    assert row["lost"] == row["events"] == 0
    assert row["alike"]["value"] in (None, 1)
    assert not [p for p in multiprocessing.active_children() if p.name.startswith("SpawnProcess")]
    live.draw([row, {**row, "p99_99 [us]": None}], Figure())


def test_a_process_that_dies_before_it_serves_is_an_error(folder):
    with live.served(folder / "none", RATE) as pipe, pytest.raises(RuntimeError, match="nothing"):
        live.received(pipe)


def test_only_alarms_beside_samples_that_were_heard_are_compared():
    times = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]
    truth = np.array([0, 1, 1, 0, 1, 0, 0, 1], dtype=bool)
    said = dict(zip(times, truth.tolist(), strict=True))
    assert live.alike(times, truth, said)["n"] == 3
    assert live.alike(times, truth, said)["value"] == 1
    del said[0.4]  # the alarm of the sample after it is not this one's
    said[0.5] = True
    found = live.alike(times, truth, said)
    assert (found["n"], found["value"]) == (2, 1)
    said[0.7] = False
    assert live.alike(times, truth, said)["value"] == 0.5
