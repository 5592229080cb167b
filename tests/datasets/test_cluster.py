"""A Ray cluster of two nodes, one of which is lost: the same bytes."""

import threading
import time

import pytest

from tauguard.datasets.configuration import load
from tauguard.datasets.generation import generate_dataset

from .conftest import contents


def test_a_cluster_that_loses_a_node_writes_the_same_bytes(tiny, tiny_toml, tmp_path):
    ray = pytest.importorskip("ray")
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    node = cluster.add_node(num_cpus=1)
    cluster.wait_for_nodes()
    folder = tmp_path / "cluster"
    gone = threading.Event()

    def lose() -> None:
        while not list(folder.glob("data/*.parquet")):
            time.sleep(0.01)
        cluster.remove_node(node, allow_graceful=False)
        gone.set()

    threading.Thread(target=lose, daemon=True).start()
    try:
        generate_dataset(load(tiny_toml), folder, ray=cluster.address)
        assert gone.wait(60)
    finally:
        ray.shutdown()
        cluster.shutdown()
    assert contents(folder) == contents(tiny)
