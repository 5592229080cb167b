"""A small dataset that several tests look at."""

import textwrap

import pytest

from tauguard.datasets.configuration import load_configuration
from tauguard.datasets.generation import generate_dataset

TINY = """
    name = "tiny"
    seed = 7
    rate = 500
    episodes_per_shard = 2
    residual = true
    [episodes]
    seconds = 6.6
    arms = ["cura6", "cura6-small"]
    speeds = [20, 50]
    payloads_g = [0, 1000]
    severities = [[8, 64]]
    [[splits]]
    name = "train"
    episodes = 3
    quick_episodes = 2
    individuals = [0, 1]
    [[splits]]
    name = "test"
    episodes = 2
    individuals = [10]
    unseen = ["individual"]
"""


@pytest.fixture(scope="session")
def tiny_toml(tmp_path_factory):
    path = tmp_path_factory.mktemp("configuration") / "tiny.toml"
    path.write_text(textwrap.dedent(TINY))
    return path


@pytest.fixture(scope="session")
def tiny(tiny_toml, tmp_path_factory):
    folder = tmp_path_factory.mktemp("datasets") / "tiny"
    generate_dataset(load_configuration(tiny_toml), folder, workers=1)
    return folder


def contents(folder):
    """Every file's bytes, by its name in the folder."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}
