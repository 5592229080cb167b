"""Run jobs in processes, and cache their results, so that a stopped run can continue."""

from __future__ import annotations

import functools
import hashlib
import io
import multiprocessing
import os
import pickle
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, is_dataclass
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from tauguard.atomic_write import write_atomic
from tauguard.report import versions

#: Packages whose data classes a cached result may contain.
OURS = ("tauguard", "studies")
#: What pickled arrays and numbers of numpy consist of.
ARRAYS = ("_reconstruct", "_frombuffer", "ndarray", "dtype", "scalar")
Each = Callable[[Callable[[Any], Any], Sequence[Any]], Iterator[Any]]


class Workers:
    """A context manager that gives a map over processes; with one worker it maps in this process.

    Each process has one thread. Results come in the order of the jobs.
    """

    #: The number of processes; None: one per processor.
    count: int | None = None

    def __init__(self) -> None:
        """Start no process yet; they start on entry."""
        self._processes: Any = None

    def __enter__(self) -> Each:
        """Start the processes; the map takes a function of a module and its jobs."""
        count = self.count or os.cpu_count() or 1
        if count == 1:
            return lambda call, jobs: map(call, jobs)
        context = multiprocessing.get_context("spawn")
        # One thread for each process: linear algebra is many times slower with more threads than
        # processors.
        self._processes = context.Pool(count, threadpool_limits, (1,))
        imap: Callable[..., Iterator[Any]] = self._processes.imap
        return imap

    def __exit__(self, *_: object) -> None:
        """Stop the processes."""
        if self._processes is not None:
            self._processes.terminate()


def build(*more: object) -> str:
    """A hash of everything that decides a detector's answers: versions, sources, and ``more``."""
    from tauguard.datasets.code_identity import detection_sources

    return hashlib.sha256(repr((more, versions(), *detection_sources())).encode()).hexdigest()[:16]


@dataclass(frozen=True)
class JobCache:
    """Results of one part's jobs in a folder; without a folder nothing is cached."""

    folder: Path | None

    @classmethod
    def of(cls, keep: str | None, study: str, seed: int, size: object) -> JobCache:
        """Use one folder for each seed, size and build.

        After a change of native code or of the study itself, use another folder: such a change is
        not detected.
        """
        if keep is None:
            return cls(None)
        folder = Path(keep) / f"{study}-seed{seed}-{build(size)[:8]}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ValueError(f"--keep {keep}: cannot be written ({error.strerror})") from None
        return cls(folder)

    def over(self, each: Each, name: str) -> Each:
        """A map like ``each`` that reads the cached results of jobs of this name."""
        return functools.partial(self._map, each, name)

    def _map(
        self, each: Each, name: str, call: Callable[[Any], Any], jobs: Sequence[Any]
    ) -> Iterator[Any]:
        if self.folder is None:
            return each(call, jobs)
        paths = [self.folder / f"{name}-{k:03d}.pickle" for k in range(len(jobs))]
        known = [path.exists() for path in paths]
        every = zip(jobs, paths, known, strict=True)
        missing = [(call, job, path) for job, path, done in every if not done]
        return _InOrder(iter(zip(paths, known, strict=True)), each(_done, missing))


@dataclass(frozen=True)
class _InOrder:
    """Results in the order of the jobs; if one raises, iteration can continue with the next."""

    jobs: Iterator[tuple[Path, bool]]  #: file of each result, and whether it is cached
    fresh: Iterator[Any]

    def __iter__(self) -> _InOrder:
        return self

    def __next__(self) -> Any:
        path, known = next(self.jobs)
        return read(path) if known else next(self.fresh)


def _done(job: tuple[Callable[[Any], Any], Any, Path]) -> Any:
    """Run a job and write its result to a file."""
    call, own, path = job
    result = call(own)
    write_atomic(path, pickle.dumps(result))
    return result


class _Results(pickle.Unpickler):
    """Reads results: arrays, plain values, and data classes of tauguard or the user's module."""

    def find_class(self, module: str, name: str) -> Any:
        package = module.partition(".")[0]
        if package in OURS:
            kind = super().find_class(module, name)
            if is_dataclass(kind):
                return kind
        if package == "numpy" and name in ARRAYS:
            return super().find_class(module, name)
        from tauguard.detectors.registry import file_type

        return file_type(f"{module}:{name}")


def read(path: Path) -> Any:
    """Read a cached result; ``ValueError`` names a damaged file."""
    try:
        return _Results(io.BytesIO(path.read_bytes())).load()
    except Exception as error:  # a damaged file can make the reader raise anything
        raise ValueError(f"{path}: damaged, or of another build: delete it ({error})") from error
