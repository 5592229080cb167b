"""Runs that end early leave whole files, and the same command completes them."""

import numpy as np
import pytest

from slow import interrupted
from slow.recordings import command


@pytest.fixture(scope="module")
def truth(tmp_path_factory):
    folder = tmp_path_factory.mktemp("truth")
    assert command(folder, 1) == 0
    return folder


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "workers"), interrupted.TRIALS)
def test_no_file_is_lost_or_damaged(kind, workers, truth, tmp_path, slow_seed, counts):
    if kind == "full disk" and not interrupted.mounting():
        pytest.skip("no small disk can be mounted here: only root can")
    (tmp_path / "truth").symlink_to(truth)
    rng, count = np.random.default_rng((slow_seed, workers)), interrupted.Count()
    for _ in range(interrupted.TRIALS[kind, workers]):
        interrupted.trial(kind, workers, tmp_path, rng, count)
    counts(trials=count.trials, **count.found, longest_s=round(count.longest, 2))
    # "late" depends on the load of the machine; a command that hangs is counted by itself.
    assert not {
        name: n for name, n in count.found.items() if n and name not in ("finished", "late")
    }
