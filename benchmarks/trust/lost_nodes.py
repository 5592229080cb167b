"""``tauguard generate --ray`` on a cluster of two nodes, one of which is lost: the same bytes."""

from __future__ import annotations

import logging
import tempfile
import textwrap
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np

from tauguard.benchmarks.trust.generated import SMALL, contents
from tauguard.datasets.configuration import load
from tauguard.datasets.generation import generate_dataset
from tauguard.report import Row

#: Runs, each on a cluster of its own, in a full and in a quick run.
RUNS = (20, 1)
#: A node is lost up to so long after the first shard [s]: a run takes a few seconds.
LATEST = 3.0


def node_rows(quick: bool, seed: int) -> list[Row]:
    """One row; a note where Ray (extra ``distributed``) is not installed."""
    try:
        import ray
        from ray.cluster_utils import Cluster
    except ImportError:
        return [{"study": "cluster", "note": "Ray is not installed (extra `distributed`)"}]
    rng = np.random.default_rng([seed, 82])
    lost, same, count = 0, 0, RUNS[quick]
    with tempfile.TemporaryDirectory() as place:
        config = Path(place) / "small.toml"
        config.write_text(textwrap.dedent(SMALL.format(seed=seed)))
        wanted = Path(place) / "wanted"
        generate_dataset(load(config), wanted, workers=1)
        for number in range(count):
            folder = Path(place) / f"lost-{number}"
            lost += _run(ray, Cluster, config, folder, rng.uniform(0, LATEST))
            same += contents(folder) == contents(wanted)
    return [{"study": "cluster", "runs": count, "nodes lost": lost, "same bytes": same}]


def _run(ray: Any, cluster_type: Any, config: Path, folder: Path, after: float) -> bool:
    """Whether the second node was lost before the end, ``after`` [s] the first shard."""
    head = {"num_cpus": 1, "include_dashboard": False}
    cluster = cluster_type(initialize_head=True, head_node_args=head)
    node = cluster.add_node(num_cpus=1)
    cluster.wait_for_nodes()
    ended = threading.Event()
    gone: list[bool] = []

    def lose() -> None:
        while not list(folder.glob("data/*.parquet")) and not ended.is_set():
            time.sleep(0.01)
        if not ended.wait(after):
            cluster.remove_node(node, allow_graceful=False)
            gone.append(not ended.is_set())

    loses = threading.Thread(target=lose, daemon=True)
    loses.start()
    try:
        ray.init(cluster.address, log_to_driver=False, logging_level=logging.ERROR)
        generate_dataset(load(config), folder, ray=cluster.address)
        ended.set()
        loses.join()
    finally:
        ray.shutdown()
        cluster.shutdown()
    return any(gone)
