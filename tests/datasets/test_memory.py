"""Generation takes the same memory however long it goes on."""

import gc

from tauguard.datasets.configuration import load_configuration
from tauguard.datasets.generation import tasks
from tauguard.datasets.shard import make_shard


def test_a_shard_leaves_nothing_for_the_search_for_cycles(tiny_toml, tmp_path):
    """Python searches for cycles by counting objects; an episode is few of them and megabytes."""
    for name in ("data", "manifest"):
        (tmp_path / name).mkdir()
    todo = list(tasks(load_configuration(tiny_toml), tmp_path))
    make_shard(todo[0])  # with what is kept once for all
    gc.collect()
    gc.disable()
    gc.set_debug(gc.DEBUG_SAVEALL)
    try:
        make_shard(todo[1])
        gc.collect()
        left = {type(x).__qualname__ for x in gc.garbage if type(x).__module__ != "builtins"}
    finally:
        gc.set_debug(0)
        gc.garbage.clear()
        gc.enable()
    assert left <= {"FreezableDefaultDict"}  # of importlib.metadata
