"""``tauguard generate --ray`` on a cluster of two nodes, one of which is lost: the same bytes."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import numpy as np

from studies.trust.generated import contents, small_dataset, start
from tauguard.report import Row

#: Runs, each on a cluster of its own, in a full and in a quick run.
RUNS = (20, 1)
#: A node is lost up to so long after the first shard [s]: a run takes a few seconds.
LATEST = 3.0
#: A run that goes on so long after the loss hangs [s].
HANGS = 120.0


def node_rows(quick: bool, seed: int) -> list[Row]:
    """One row; a note where Ray (extra ``distributed``) is not installed."""
    try:
        from ray.cluster_utils import Cluster
    except ImportError:
        return [{"study": "cluster", "note": "Ray is not installed (extra `distributed`)"}]
    rng = np.random.default_rng([seed, 82])
    lost, same, count = 0, 0, RUNS[quick]
    with small_dataset(seed) as (config, wanted):
        for number in range(count):
            folder = config.parent / f"lost-{number}"
            lost += _run(Cluster, config, folder, rng.uniform(0, LATEST))
            same += contents(folder) == wanted
    return [{"study": "cluster", "runs": count, "nodes lost": lost, "same bytes": same}]


def _run(cluster_type: Any, config: Path, folder: Path, after: float) -> bool:
    """Whether the second node was lost before the end, ``after`` [s] the first shard."""
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
    except subprocess.TimeoutExpired:
        raise RuntimeError(f"tauguard generate --ray hangs for {HANGS:g} s: a node lost") from None
    finally:
        if command is not None and command.poll() is None:
            os.killpg(command.pid, signal.SIGKILL)
        cluster.shutdown()
