"""Run jobs in processes, and cache their results, so that a stopped run can continue."""

from __future__ import annotations

import functools
import hashlib
import io
import json
import multiprocessing
import os
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from tauguard.atomic_write import write_atomic
from tauguard.report import versions

#: Packages whose data classes a cached result may contain.
OURS = ("tauguard", "studies")
Each = Callable[[Callable[[Any], Any], Sequence[Any]], Iterator[Any]]


class Workers:
    """A context manager that gives a map over processes; with one worker it maps in this process.

    Each process has one thread. Results come in the order of the jobs.
    """

    #: The number of processes; None: one per processor.
    count: int | None = None
    _processes: Any = None

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
    """A hash of versions, the Python sources of detectors and simulation, and ``more``."""
    from tauguard.datasets.code_identity import detection_sources

    return hashlib.sha256(repr((more, versions(), *detection_sources())).encode()).hexdigest()[:16]


@dataclass(frozen=True)
class JobCache:
    """Results of the jobs of a study's part in a folder; without one nothing is cached."""

    folder: Path | None

    @classmethod
    def of(cls, keep: str | None, study: str, seed: int, size: object) -> JobCache:
        """A cache in ``keep``, with a folder for each study, seed and hash (:func:`build`).

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
        paths = [self.folder / f"{name}-{k:03d}.npz" for k in range(len(jobs))]
        kept = {path for path in paths if path.exists()}
        every = zip(jobs, paths, strict=True)
        fresh = each(_done, [(call, job, path) for job, path in every if path not in kept])
        # After an error, iteration can continue with the next job, unlike that of a generator.
        return map(lambda path: read(path) if path in kept else next(fresh), paths)


def _done(job: tuple[Callable[[Any], Any], Any, Path]) -> Any:
    """Run a job and write its result to a file."""
    call, own, path = job
    result = call(own)
    try:
        write_atomic(path, _data(result))
    except ValueError as error:
        warnings.warn(f"{path} is not kept: {error}", stacklevel=1)
    return result


def _data(result: Any) -> bytes:
    """The bytes of a file with the arrays, and a JSON list of all objects, parts first."""
    objects, places, arrays = list[Any](), dict[int, list[int]](), dict[str, Any]()

    def listed(value: Any) -> Any:
        kind, name = type(value), type(value).__name__
        parts: Any = None
        if value is None or kind in (bool, int, float, str):
            return value
        if id(value) in places:
            return places[id(value)]
        if kind in (list, tuple):
            parts = [listed(one) for one in value]
        elif kind is dict:
            parts = [[listed(one) for one in pair] for pair in value.items()]
        elif is_dataclass(kind):
            name = f"{kind.__module__}:{kind.__qualname__}"
            parts = {own.name: listed(getattr(value, own.name)) for own in fields(kind) if own.init}
        elif isinstance(value, np.ndarray | np.generic) and not value.dtype.hasobject:
            name, arrays[str(len(objects))] = "array", value
        else:
            raise ValueError(f"a {name} is neither an array nor a data class nor plain data")
        objects.append([name, parts])
        return places.setdefault(id(value), [len(objects) - 1])

    file, text = io.BytesIO(), json.dumps([listed(result), objects])
    np.savez(file, objects=np.frombuffer(text.encode(), np.uint8), **arrays)
    return file.getvalue()


def _type(name: str) -> Any:
    """A data class in a module that is loaded, of a detector, or in the user's module."""
    from tauguard.detectors.registry import file_type

    module, _, own = name.partition(":")
    ours = module.partition(".")[0] in OURS
    kind = getattr(sys.modules.get(module), own, None) if ours else None
    kind = kind or file_type(own if ours else name)
    if not (isinstance(kind, type) and is_dataclass(kind)):
        raise ValueError(f"{name} is no data class")
    return kind


def read(path: Path) -> Any:
    """Read a cached result; ``ValueError`` names a damaged file."""
    made: list[Any] = []

    def value(part: Any) -> Any:
        return made[part[0]] if isinstance(part, list) else part

    try:
        with np.load(path, allow_pickle=False) as arrays:
            if any(member.compress_type for member in arrays.zip.infolist()):
                raise ValueError("compressed")  # it might not fit in memory
            result, objects = json.loads(arrays["objects"].tobytes())
            for k, (name, parts) in enumerate(objects):
                if name == "array":
                    made.append(arrays[str(k)][()])
                elif name == "dict":
                    made.append({value(key): value(one) for key, one in parts})
                elif name in ("list", "tuple"):
                    made.append((list if name == "list" else tuple)(map(value, parts)))
                else:
                    made.append(_type(name)(**{own: value(one) for own, one in parts.items()}))
        return value(result)
    except Exception as error:  # a damaged file can make the reader raise anything
        raise ValueError(f"{path}: damaged, or of other code: delete it ({error})") from error
