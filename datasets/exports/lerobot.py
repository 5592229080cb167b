"""Write LeRobotDataset v3.0 with pyarrow, because LeRobot requires other versions of packages.

Layout: https://huggingface.co/docs/lerobot/lerobot-dataset-v3. A dataset on the hub needs the git
tag ``v3.0``; otherwise LeRobot's loader refuses it.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from tauguard.atomic_write import atomic_file, write_atomic
from tauguard.findings import ArgumentError
from tauguard.traces import Trace

Array = NDArray[Any]

LEROBOT_VERSION = "v3.0"
TASK = "move between random poses; collisions are labelled"
#: Rows of a data file: about 100 MB (LeRobot's default) with six joints.
ROWS_A_FILE = 1_000_000
CHUNK = 1000


def write_lerobot(traces: Iterable[Trace], folder: Path, rate: int, robot: str) -> int:
    """Write traces with truth as one LeRobot dataset; returns the number of episodes.

    Args:
        traces: one per episode, all with the same number of joints.
        folder: new or empty.
        rate: sample rate of the traces [Hz].
        robot: LeRobot's ``robot_type``.

    Raises:
        ArgumentError: the folder is not empty, no traces, or traces without truth.
        OSError: the folder cannot be written.
    """
    if folder.exists() and any(folder.iterdir()):
        raise ArgumentError(f"{folder}: not empty; name a new folder")
    for name in ("meta/episodes/chunk-000", "data"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    episodes: list[dict[str, Any]] = []
    names: tuple[str, ...] = ()
    for number, group in enumerate(_files(traces)):
        where = {"chunk": number // CHUNK, "file": number % CHUNK}
        _write_file(folder, where, group, episodes)
        names = group[0].joint_names
    if not episodes:
        raise ArgumentError("no episodes to export")
    _write_meta(folder, episodes, rate, robot, features(names))
    return len(episodes)


def features(names: tuple[str, ...]) -> dict[str, dict[str, Any]]:
    """LeRobot's description of the columns."""

    def wide(*signals: str) -> dict[str, Any]:
        every = [f"{signal}.{joint}" for signal in signals for joint in names]
        return {"dtype": "float32", "shape": [len(every)], "names": every}

    one = {"shape": [1], "names": None}
    return {
        "observation.state": wide("q", "qd", "current"),
        "action": wide("q_des", "qd_des"),
        "truth.tau_ext": wide("tau_ext"),
        "truth.contact_force": {"dtype": "float32", "shape": [3], "names": ["x", "y", "z"]},
        "truth.contact_link": {"dtype": "int64", **one},
        "truth.collision": {"dtype": "int64", **one},
        "timestamp": {"dtype": "float32", **one},
        "frame_index": {"dtype": "int64", **one},
        "episode_index": {"dtype": "int64", **one},
        "index": {"dtype": "int64", **one},
        "task_index": {"dtype": "int64", **one},
    }


def columns_of(trace: Trace, episode: int, first: int) -> dict[str, Array]:
    """A trace as LeRobot's columns; ``first`` is the index of its first row in the dataset."""
    truth = trace.truth
    if truth is None or trace.q_des is None or trace.qd_des is None:
        raise ArgumentError("a trace without truth or references cannot be exported to LeRobot")
    rows = len(trace.t)
    busy = np.zeros(rows, bool)
    for one in truth.collisions:
        busy |= (trace.t >= one.onset) & (trace.t <= one.end)
    found: dict[str, Array] = {
        "observation.state": np.hstack([trace.q, trace.qd, trace.current]),
        "action": np.hstack([trace.q_des, trace.qd_des]),
        "truth.tau_ext": truth.tau_ext,
        "truth.contact_force": truth.contact_vector,
        "truth.contact_link": truth.contact_link,
        "truth.collision": busy,
        "timestamp": trace.t - trace.t[0],
        "frame_index": np.arange(rows),
        "episode_index": np.full(rows, episode),
        "index": first + np.arange(rows),
        "task_index": np.zeros(rows),
    }
    kinds = features(trace.joint_names)
    return {name: x.astype(kinds[name]["dtype"]) for name, x in found.items()}


def moments(values: Array) -> dict[str, Array]:
    """Statistics of a column's values, shape (T,) or (T, c), under LeRobot's names."""
    wide = values.reshape(len(values), -1).astype(np.float64)
    found = {name: getattr(wide, name)(axis=0) for name in ("min", "max", "mean", "std")}
    return {**found, "count": np.array([len(wide)])}


def combined(parts: Sequence[dict[str, Array]]) -> dict[str, Array]:
    """Statistics of all rows, from the :func:`moments` of parts of them."""
    low, high, mean, std, count = (
        np.array([part[name] for part in parts]) for name in ("min", "max", "mean", "std", "count")
    )
    weight = count / count.sum()
    middle = (weight * mean).sum(axis=0)
    variance = (weight * (std**2 + (mean - middle) ** 2)).sum(axis=0)
    ends = {"min": low.min(axis=0), "max": high.max(axis=0)}
    return {**ends, "mean": middle, "std": np.sqrt(variance), "count": count.sum(axis=0)}


def _files(traces: Iterable[Trace]) -> Iterator[list[Trace]]:
    group: list[Trace] = []
    for trace in traces:
        if group and sum(len(t.t) for t in group) + len(trace.t) > ROWS_A_FILE:
            yield group
            group = []
        group.append(trace)
    if group:
        yield group


def _write_file(
    folder: Path, where: dict[str, int], group: list[Trace], episodes: list[dict[str, Any]]
) -> None:
    path = folder / "data" / f"chunk-{where['chunk']:03d}" / f"file-{where['file']:03d}.parquet"
    path.parent.mkdir(exist_ok=True)
    first = episodes[-1]["dataset_to_index"] if episodes else 0
    tables = []
    for trace in group:
        columns = columns_of(trace, len(episodes), first)
        episodes.append(_episode(len(episodes), first, where, columns))
        first += len(trace.t)
        tables.append(pa.table({name: _column(x) for name, x in columns.items()}))
    with atomic_file(path) as stream:
        pq.write_table(pa.concat_tables(tables), stream, compression="zstd")


def _column(values: Array) -> pa.Array:
    if values.ndim == 1:
        return pa.array(values)
    flat = pa.array(np.ascontiguousarray(values).ravel())
    return pa.FixedSizeListArray.from_arrays(flat, values.shape[1])


def _episode(
    number: int, first: int, where: dict[str, int], columns: dict[str, Array]
) -> dict[str, Any]:
    rows = len(columns["timestamp"])
    line: dict[str, Any] = {
        "episode_index": number,
        "tasks": [TASK],
        "length": rows,
        "data/chunk_index": where["chunk"],
        "data/file_index": where["file"],
        "dataset_from_index": first,
        "dataset_to_index": first + rows,
        "meta/episodes/chunk_index": 0,
        "meta/episodes/file_index": 0,
    }
    for name, x in columns.items():
        line |= {f"stats/{name}/{key}": value.tolist() for key, value in moments(x).items()}
    return line


def _write_meta(
    folder: Path,
    episodes: list[dict[str, Any]],
    rate: int,
    robot: str,
    described: dict[str, dict[str, Any]],
) -> None:
    with atomic_file(folder / "meta/episodes/chunk-000/file-000.parquet") as stream:
        pq.write_table(pa.Table.from_pylist(episodes), stream, compression="zstd")
    with atomic_file(folder / "meta/tasks.parquet") as stream:
        pq.write_table(_tasks(), stream)
    stats = {name: _stats(name, episodes) for name in described}
    write_atomic(folder / "meta/stats.json", json.dumps(stats, indent=1) + "\n")
    info = {
        "codebase_version": LEROBOT_VERSION,
        "robot_type": robot,
        "total_episodes": len(episodes),
        "total_frames": episodes[-1]["dataset_to_index"],
        "total_tasks": 1,
        "chunks_size": CHUNK,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": rate,
        "splits": {"train": f"0:{len(episodes)}"},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": None,
        "features": described,
    }
    write_atomic(folder / "meta/info.json", json.dumps(info, indent=1) + "\n")


def _stats(name: str, episodes: list[dict[str, Any]]) -> dict[str, list[float]]:
    """Statistics of a column over all episodes."""
    keys = ("min", "max", "mean", "std", "count")
    parts = [{key: line[f"stats/{name}/{key}"] for key in keys} for line in episodes]
    return {key: value.tolist() for key, value in combined(parts).items()}


def _tasks() -> pa.Table:
    """The only task, as a pandas table with the task as index (LeRobot's form)."""
    index = "__index_level_0__"
    columns: list[dict[str, Any]] = [
        {"name": "task_index", "field_name": "task_index", "pandas_type": "int64"},
        {"name": None, "field_name": index, "pandas_type": "unicode"},
    ]
    kinds = ("int64", "object")
    pandas = {
        "index_columns": [index],
        "column_indexes": [],
        "columns": [
            {**column, "numpy_type": kind, "metadata": None}
            for column, kind in zip(columns, kinds, strict=True)
        ],
        "pandas_version": "2.0.0",
    }
    table = pa.table({"task_index": pa.array([0], pa.int64()), index: pa.array([TASK])})
    return table.replace_schema_metadata({"pandas": json.dumps(pandas)})
