"""Generate a dataset shard by shard, in processes or on a Ray cluster; a run can be resumed."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tqdm import tqdm

from tauguard.atomic_write import remove_parts
from tauguard.datasets.card import write_cards
from tauguard.datasets.code_identity import code
from tauguard.datasets.configuration import Configuration
from tauguard.datasets.dataset_folder import claimed, shards
from tauguard.datasets.shard import Done, ShardTask, make_shard
from tauguard.datasets.workers import terminable, writing


@dataclass
class Built:
    """Counts of one run."""

    made: int = 0  #: shards written
    kept: int = 0  #: shards that were intact already
    episodes: int = 0  #: episodes in all shards
    seconds: float = 0.0  #: simulated time of this run [s]


def generate_dataset(
    configuration: Configuration,
    folder: Path,
    workers: int | None = None,
    ray: str | None = None,
) -> Built:
    """Write the shards of a dataset that are missing or damaged.

    The bytes do not depend on the number of workers or on the use of a cluster.

    Args:
        configuration: description of the dataset.
        folder: created if it does not exist; otherwise it must be empty or hold this dataset.
        workers: number of processes (default: one per processor); 1 computes in this process.
        ray: address of a Ray cluster to work on instead ("local" starts one here).

    Raises:
        ValueError: the folder holds something else; nothing in it is changed.
        OSError: the folder cannot be written, another process is writing it, or a worker died.
    """
    count = workers or os.cpu_count() or 1
    done = Built()
    todo = tasks(configuration, folder)
    with terminable(), claimed(folder, configuration), contextlib.ExitStack() as stack:
        if ray is None:
            results: Iterator[Done] = stack.enter_context(writing(make_shard, todo, count, folder))
        else:
            from tauguard.datasets.cluster import on_cluster

            stack.callback(remove_parts, folder)
            results = stack.enter_context(contextlib.closing(on_cluster(make_shard, todo, ray)))
        total = sum(split.episodes for split in configuration.splits)
        with tqdm(total=total, desc="generate", unit="episode", disable=None, leave=False) as bar:
            for one in results:
                _count(done, one, bar)
        write_cards(folder)
    return done


def tasks(configuration: Configuration, folder: Path) -> Iterator[ShardTask]:
    """Every shard's task, split by split."""
    text, code_hash = configuration.to_json(), code()
    for split, number in shards(configuration):
        yield ShardTask(str(folder.resolve()), text, split, number, code_hash)


def _count(done: Built, one: Done, bar: tqdm[None]) -> None:
    done.episodes += one.episodes
    if one.kept:
        done.kept += 1
    else:
        done.made += 1
        done.seconds += one.seconds
    bar.update(one.episodes)
