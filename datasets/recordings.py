"""Simulate episodes into a folder, one MCAP file each (a run can be resumed), and read them."""

import contextlib
import os
from collections.abc import Generator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from tqdm import tqdm

from tauguard.atomic_write import remove_parts
from tauguard.datasets.log_checks import checked
from tauguard.datasets.reader import is_dataset, training_episodes
from tauguard.datasets.workers import in_processes, terminable
from tauguard.envs import Episode, simulate
from tauguard.findings import FileError
from tauguard.traces import Trace, read_mcap, write_mcap
from tauguard.untrusted_input import reading


def simulate_all(
    episodes: Sequence[Episode],
    workers: int | None = None,
    label: str = "simulate",
    checkers: Sequence[str] = (),
) -> Generator[Trace]:
    """Simulate episodes and yield their traces in the given order.

    Args:
        episodes: to simulate.
        workers: number of processes (default: one per processor); 1 computes in this process.
        label: text of the progress bar.
        checkers: names of contact checkers that fill ``Trace.contacts``. A checker of your own
            must be registered in a module that worker processes import, or ``workers`` must be 1.
    """
    workers = min(workers or os.cpu_count() or 1, max(len(episodes), 1))
    bar = tqdm(total=len(episodes), desc=label, unit="episode", disable=None, leave=False)
    one = partial(_numbered, checkers=tuple(checkers))
    results = in_processes(one, enumerate(episodes), workers)
    with bar, contextlib.closing(results):
        early: dict[int, Trace] = {}
        wanted = 0
        for number, trace in results:
            bar.update()
            early[number] = trace
            while wanted in early:
                yield early.pop(wanted)
                wanted += 1


def _numbered(task: tuple[int, Episode], checkers: tuple[str, ...]) -> tuple[int, Trace]:
    number, episode = task
    return number, simulate(episode, checkers=checkers)


def write_dataset(
    episodes: Sequence[Episode],
    folder: Path,
    workers: int | None = None,
    checkers: Sequence[str] = (),
) -> list[Path]:
    """Write one MCAP file per episode into ``folder``; existing files of the episodes are kept.

    Args:
        episodes: to simulate.
        folder: created if it does not exist.
        workers: number of processes (default: one per processor); 1 computes in this process.
        checkers: as for :func:`simulate_all`.

    Raises:
        OSError: the folder cannot be created or written, or a worker died.
        FileError: an unknown checker, or a file of the episode with contacts of other checkers
            (nothing is overwritten).
    """
    from tauguard.contacts import registered  # here, as it takes long to import

    for name in checkers:
        if name not in registered():
            raise FileError(f"checkers {name!r}: expected some of {', '.join(registered())}")
    folder.mkdir(parents=True, exist_ok=True)
    paths = [_place(folder, i, episode) for i, episode in enumerate(episodes)]
    missing = [i for i, path in enumerate(paths) if not _holds(path, episodes[i], checkers)]
    traces = simulate_all([episodes[i] for i in missing], workers, checkers=checkers)
    remove_parts(folder)
    with terminable(), contextlib.closing(traces):
        for i, trace in zip(missing, traces, strict=True):
            write_mcap(paths[i], trace)
    return paths


def _place(folder: Path, number: int, episode: Episode) -> Path:
    """The path of an episode; its name contains a hash of the episode's settings."""
    kind = "episode" if episode.collisions or episode.objects else "free"
    old = folder / f"episode-{number:05d}.mcap"  # the name in earlier versions
    if old.exists() and read_mcap(old).meta.get("config_sha256") == episode.config_hash:
        return old
    return folder / f"{kind}-{number:05d}-{episode.config_hash[:6]}.mcap"


def _holds(path: Path, episode: Episode, checkers: Sequence[str]) -> bool:
    if not path.exists():
        return False
    trace = read_mcap(path)
    seen = [one.checker for one in trace.contacts]
    if seen != list(checkers):
        raise FileError(
            f"{path}: holds contacts of {', '.join(seen) or 'no checker'}, not of "
            f"{', '.join(checkers) or 'no checker'}; choose another folder or remove it"
        )
    return True


def labelled(folder: Path, arm: str | None = None) -> list[Trace]:
    """The labelled recordings in a folder and those below it, in the order of their paths.

    Args:
        folder: folder of MCAP recordings, or a dataset of `tauguard generate`, whose first split is
            read.
        arm: in a dataset with several arms, the one whose episodes are read.

    Returns:
        Traces with truth; ``meta["log"]`` is the file's path below the folder.

    Raises:
        FileError: no recordings there, or one without truth; the message names it.
        FileNotFoundError: no such folder.
    """
    if not folder.is_dir():
        raise FileNotFoundError(
            f"{folder}: no such folder; `out=` of `tauguard simulate` makes one"
        )
    if is_dataset(folder):
        return training_episodes(folder, arm)
    if arm is not None:
        raise FileError(f'`arm="{arm}"`: {folder} is no dataset, so its recordings are of one arm')
    paths = sorted(folder.rglob("*.mcap"))
    if not paths:
        raise FileError(f"{folder}: no .mcap files; `out=` of `tauguard simulate` writes some")
    traces = []
    for path in tqdm(paths, desc="read", unit="file", disable=None, leave=False):
        trace = read_mcap(path)
        if trace.truth is None:
            raise FileError(f"{path}: no truth in it; only simulated recordings have it")
        with reading(path):  # refuses gaps, which would count as time without an alarm
            checked(trace, lambda row: f"sample {row}")
        traces.append(replace(trace, meta={**trace.meta, "log": str(path.relative_to(folder))}))
    return traces
