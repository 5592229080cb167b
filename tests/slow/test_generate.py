"""``tauguard generate`` killed, or without one node of its cluster, ends in the same bytes."""

from __future__ import annotations

import contextlib
import hashlib
import os
import signal
import subprocess
import sys
import tempfile
import textwrap
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tauguard.datasets.configuration import load_configuration
from tauguard.datasets.generation import generate_dataset

#: Runs that are killed with each number of workers, and runs of which a node is lost.
KILLS, LOSSES = 20, 20
#: The node is lost at most this time after the first shard [s]: a run takes a few seconds.
LATEST = 3.0
#: A run that lasts longer after the loss hangs [s].
HANGS = 120.0
#: A dataset of many small shards: most moments are in the middle of one.
SMALL = """
    name = "small"
    seed = {seed}
    rate = 500
    episodes_per_shard = 1
    residual = true
    [episodes]
    seconds = 6.6
    arms = ["cura6", "cura6-long"]
    individuals = [0, 1]
    speeds = [20, 50]
    payloads_g = [0, 1000]
    severities = [[8, 64]]
    [[splits]]
    name = "train"
    episodes = 6
"""


@contextlib.contextmanager
def small_dataset(seed: int) -> Iterator[tuple[Path, dict[str, str]]]:
    """The dataset's configuration file, and the :func:`contents` that one process writes."""
    with tempfile.TemporaryDirectory() as place:
        config = Path(place) / "small.toml"
        config.write_text(textwrap.dedent(SMALL.format(seed=seed)))
        wanted = Path(place) / "wanted"
        generate_dataset(load_configuration(config), wanted, workers=1)
        yield config, contents(wanted)


def contents(folder: Path) -> dict[str, str]:
    """SHA-256 of every file by its name in the folder."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def start(config: Path, folder: Path, *flags: str) -> subprocess.Popen[bytes]:
    """Start ``tauguard generate`` with these flags in a process group of its own."""
    program = "from tauguard.cli import main; main()"
    return subprocess.Popen(
        [sys.executable, "-c", program, "generate", str(config), "--out", str(folder), *flags],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def _wait(folder: Path, command: subprocess.Popen[bytes]) -> None:
    """Wait until the dataset is begun: before that there is nothing to lose."""
    while not (folder / "dataset.json").exists() and command.poll() is None:
        time.sleep(0.002)


def _timed(config: Path, folder: Path, workers: int) -> tuple[float, float]:
    """The times at which an undisturbed run begins the dataset and ends."""
    command = start(config, folder, "--workers", str(workers))
    _wait(folder, command)
    begun = time.monotonic()
    if command.wait() != 0:
        raise RuntimeError(f"tauguard generate --workers {workers} failed")
    return begun, time.monotonic()


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_killed_runs_are_continued_to_the_same_bytes(workers, slow_seed, counts):
    rng = np.random.default_rng([slow_seed, 81])
    same, midway = 0, 0
    with small_dataset(slow_seed) as (config, wanted):
        timed = config.parent / "timed"
        begun, ended = _timed(config, timed, workers)
        assert contents(timed) == wanted
        for number in range(KILLS):
            folder = config.parent / f"killed-{number}"
            command = start(config, folder, "--workers", str(workers))
            _wait(folder, command)
            time.sleep(rng.uniform(0, 1.1 * (ended - begun)))
            os.killpg(command.pid, signal.SIGKILL)
            midway += command.wait() != 0
            generate_dataset(load_configuration(config), folder, workers=1)
            same += contents(folder) == wanted
    counts(kills=KILLS, before_the_end=midway, same_bytes=same)
    assert same == KILLS
    assert midway > 0


@pytest.mark.slow
def test_a_cluster_that_loses_a_node_writes_the_same_bytes(slow_seed, counts):
    cluster = pytest.importorskip("ray.cluster_utils").Cluster
    rng = np.random.default_rng([slow_seed, 82])
    lost, same = 0, 0
    with small_dataset(slow_seed) as (config, wanted):
        for number in range(LOSSES):
            folder = config.parent / f"lost-{number}"
            lost += _loses_a_node(cluster, config, folder, rng.uniform(0, LATEST))
            same += contents(folder) == wanted
    counts(runs=LOSSES, nodes_lost=lost, same_bytes=same)
    assert same == LOSSES
    assert lost > 0


def _loses_a_node(cluster_type: Any, config: Path, folder: Path, after: float) -> bool:
    """Whether the second of two nodes was lost before the end, ``after`` [s] the first shard."""
    head = {"num_cpus": 1, "include_dashboard": False}
    cluster = cluster_type(initialize_head=True, head_node_args=head)
    command = None
    try:
        node = cluster.add_node(num_cpus=1)
        cluster.wait_for_nodes()
        command = start(config, folder, "--ray", cluster.address)
        while not list(folder.glob("data/*.parquet")) and command.poll() is None:
            time.sleep(0.01)
        time.sleep(after)
        midway = command.poll() is None
        cluster.remove_node(node, allow_graceful=False)
        command.wait(HANGS)
        return midway
    finally:
        if command is not None and command.poll() is None:
            os.killpg(command.pid, signal.SIGKILL)
        cluster.shutdown()
