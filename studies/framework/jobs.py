"""Jobs over processes, and the cache of their results: a run that was stopped goes on there.

A result is text, numbers, arrays, lists, tuples, dictionaries and dataclasses of these. Its file
holds arrays and JSON; nothing in it is code, and a class is built only if it is one of ours or of a
module that the user has named.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import json
import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from tauguard.atomic_write import atomic_file
from tauguard.report import versions

Each = Callable[[Callable[[Any], Any], Sequence[Any]], Iterator[Any]]


class Workers:
    """A context manager that gives a map over processes, in this one if one worker is asked for.

    Each process has one thread; answers come in the order of the jobs.
    """

    def __init__(self, count: int | None = None) -> None:
        """Keep the number of processes (default: one a processor)."""
        self._count = count or os.cpu_count() or 1
        self._processes: Any = None

    def __enter__(self) -> Callable[[Callable[[Any], Any], Sequence[Any]], Iterator[Any]]:
        """Start the processes; the map takes a function of a module and its jobs."""
        if self._count == 1:
            return lambda call, jobs: map(call, jobs)
        context = multiprocessing.get_context("spawn")
        # One thread a process: more of both than processors slows linear algebra many times over.
        self._processes = context.Pool(self._count, threadpool_limits, (1,))
        imap: Callable[..., Iterator[Any]] = self._processes.imap
        return imap

    def __exit__(self, *_: object) -> None:
        """Stop the processes."""
        if self._processes is not None:
            self._processes.terminate()


@dataclass(frozen=True)
class JobCache:
    """The results of one part's jobs in a folder; without a folder nothing is kept."""

    folder: Path | None

    @classmethod
    def of(cls, keep: str | None, study: str, seed: int, size: object) -> JobCache:
        """One folder a seed, size and build.

        A build is the versions of the libraries and the sources of simulation and detectors. A
        change of native code or of the study itself is not seen: take another folder then.

        Raises:
            ValueError: the folder cannot be made.
        """
        if keep is None:
            return cls(None)
        from tauguard.datasets.code_identity import detection_sources

        build = (versions(), *detection_sources())
        digest = hashlib.sha256(repr((size, build)).encode()).hexdigest()[:8]
        folder = Path(keep) / f"{study}-seed{seed}-{digest}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ValueError(f"--keep {keep}: cannot be written ({error.strerror})") from None
        return cls(folder)

    def over(self, each: Each, name: str) -> Each:
        """``each`` for jobs of this name: those whose results are kept are not done again."""
        return functools.partial(self._map, each, name)

    def _map(
        self, each: Each, name: str, call: Callable[[Any], Any], jobs: Sequence[Any]
    ) -> Iterator[Any]:
        if self.folder is None:
            return each(call, jobs)
        paths = [self.folder / f"{name}-{k:03d}.npz" for k in range(len(jobs))]
        known = [path.exists() for path in paths]
        missing = [
            (call, job, path)
            for job, path, done in zip(jobs, paths, known, strict=True)
            if not done
        ]
        return _InOrder(iter(zip(paths, known, strict=True)), each(_done, missing))


@dataclass(frozen=True)
class _InOrder:
    """Results in the order of the jobs; after one that raises the others still come."""

    jobs: Iterator[tuple[Path, bool]]  #: and whether they are kept
    fresh: Iterator[Any]

    def __iter__(self) -> _InOrder:
        return self

    def __next__(self) -> Any:
        path, known = next(self.jobs)
        return read(path) if known else next(self.fresh)


def _done(job: tuple[Callable[[Any], Any], Any, Path]) -> Any:
    """Do a job and keep its result."""
    call, own, path = job
    result = call(own)
    write(path, result)
    return result


def write(path: Path, value: object) -> None:
    """Write a result, whole or not at all.

    Raises:
        ValueError: something in it cannot be kept; the message names its type.
        OSError: the folder cannot be written.
    """
    arrays: list[np.ndarray] = []
    text = json.dumps(_apart(value, arrays))
    named = {f"array{k}": array for k, array in enumerate(arrays)}
    with atomic_file(path) as stream:
        np.savez_compressed(stream, json=np.array(text), **named)  # type: ignore[arg-type]


def read(path: Path) -> Any:
    """What :func:`write` wrote.

    Raises:
        ValueError: a damaged file, or one of another build; it names what to delete.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            return _together(json.loads(str(file["json"])), file)
    except Exception as error:  # whatever a damaged archive makes its readers raise
        raise ValueError(f"{path}: damaged, or of another build: delete it ({error})") from error


def _apart(value: Any, arrays: list[np.ndarray]) -> Any:
    """``value`` as JSON; arrays are put on the list and named by their number."""
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray) and value.dtype.kind in "fiub":
        arrays.append(value)
        return {"array": len(arrays) - 1}
    if type(value) in (list, tuple):
        return {type(value).__name__: [_apart(item, arrays) for item in value]}
    if isinstance(value, dict):
        return {"dict": [[_apart(k, arrays), _apart(v, arrays)] for k, v in value.items()]}
    if is_dataclass(value) and not isinstance(value, type):
        kind = type(value)
        own = {field.name: _apart(getattr(value, field.name), arrays) for field in fields(kind)}
        return {"class": f"{kind.__module__}:{kind.__qualname__}", "fields": own}
    raise ValueError(f"a {type(value).__name__} cannot be kept")


def _together(content: Any, arrays: Any) -> Any:
    if not isinstance(content, dict):
        return content
    if "class" in content:
        own = {name: _together(item, arrays) for name, item in content["fields"].items()}
        return _class(content["class"])(**own)
    if "array" in content:
        return arrays[f"array{content['array']}"]
    if "dict" in content:
        return {_together(k, arrays): _together(v, arrays) for k, v in content["dict"]}
    ((kind, items),) = content.items()
    return {"list": list, "tuple": tuple}[kind](_together(item, arrays) for item in items)


def _class(name: str) -> Any:
    module, _, own = name.partition(":")
    if module.partition(".")[0] not in ("tauguard", "studies"):
        from tauguard.detectors.registry import file_type

        return file_type(name)
    kind = getattr(importlib.import_module(module), own)
    if not (isinstance(kind, type) and is_dataclass(kind)):
        raise ValueError(f"{name} is no class of results")
    return kind
