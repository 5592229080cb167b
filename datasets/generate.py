"""Generation of labelled episodes: parallel, in order, resumable."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Generator, Sequence
from functools import partial
from pathlib import Path

from tqdm import tqdm

from tauguard.atomic_write import remove_parts
from tauguard.datasets.workers import in_processes, terminable
from tauguard.envs import Episode, simulate
from tauguard.traces import Trace, read_mcap, write_mcap


def simulate_all(
    episodes: Sequence[Episode],
    workers: int | None = None,
    label: str = "simulate",
    checkers: Sequence[str] = (),
) -> Generator[Trace]:
    """The traces of ``episodes`` in their order, whatever the number of workers.

    Args:
        episodes: what to simulate.
        workers: processes (default: the processors there are); 1 stays in this process.
        label: of the progress bar.
        checkers: names of contact checkers whose answers go into ``Trace.contacts``. One that is
            not among ours must be registered where a worker imports it, or ``workers`` be 1.
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
    """Write one MCAP an episode into ``folder``; whole files of the same episodes are kept.

    Args:
        episodes: what to simulate.
        folder: made if it does not exist.
        workers: processes (default: the processors there are); 1 stays in this process.
        checkers: as for :func:`simulate_all`.

    Raises:
        OSError: the folder cannot be made or written, or a worker died.
        ValueError: an unknown checker; a file of that name holds another episode or other checkers
            (nothing is overwritten).
    """
    from tauguard.contacts import registered  # and its room, which takes long to import

    for name in checkers:
        if name not in registered():
            raise ValueError(f"checkers {name!r}: expected some of {', '.join(registered())}")
    folder.mkdir(parents=True, exist_ok=True)
    width = max(5, len(str(len(episodes))))
    paths = [folder / f"episode-{i:0{width}d}.mcap" for i in range(len(episodes))]
    missing = [i for i, path in enumerate(paths) if not _holds(path, episodes[i], checkers)]
    traces = simulate_all([episodes[i] for i in missing], workers, checkers=checkers)
    remove_parts(folder)
    with terminable(), contextlib.closing(traces):
        for i, trace in zip(missing, traces, strict=True):
            write_mcap(paths[i], trace)
    return paths


def _holds(path: Path, episode: Episode, checkers: Sequence[str]) -> bool:
    if not path.exists():
        return False
    trace, _ = read_mcap(path)
    if trace.meta.get("config_sha256") != episode.config_hash:
        raise ValueError(
            f"{path}: holds another episode than this seed and these settings give; "
            "choose another folder or remove it"
        )
    seen = [one.checker for one in trace.contacts]
    if seen != list(checkers):
        raise ValueError(
            f"{path}: holds contacts of {', '.join(seen) or 'no checker'}, not of "
            f"{', '.join(checkers) or 'no checker'}; choose another folder or remove it"
        )
    return True
