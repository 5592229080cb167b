"""A shard is a few episodes of one split. One task simulates and writes one shard."""

import contextlib
import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from tauguard.arrays import Array
from tauguard.atomic_write import atomic_file, write_atomic
from tauguard.datasets.code_identity import code
from tauguard.datasets.columns_of_shards import (
    RESIDUAL,
    collision_line,
    given,
    rounded,
    schema,
    stored,
    table,
)
from tauguard.datasets.configuration import Configuration
from tauguard.datasets.robots import check_unchanged
from tauguard.datasets.schedule import Planned, planned
from tauguard.detectors import RobotNumbers, observe
from tauguard.envs import Simulation, SimulationDiverged
from tauguard.findings import FileError
from tauguard.models import Drive, pin_model
from tauguard.traces import Trace

#: Gain of the momentum observer [1/s].
OBSERVER_GAIN = 50.0
#: Nominal Coulomb friction is multiplied by tanh of the velocity divided by this [rad/s].
STANDSTILL = 0.05
#: Rate of the physics [Hz].
PHYSICS_RATE = 1000
#: Compression level of zstd; higher levels take much longer and save a few percent.
ZSTD_LEVEL = 3


@dataclass(frozen=True)
class ShardTask:
    """A shard that a worker process is to make."""

    folder: str  #: the dataset's folder
    configuration: str  #: the dataset's configuration as JSON
    split: str
    number: int  #: number of the shard within the split
    code: str  #: hash of the code that must compute the shard


@dataclass(frozen=True)
class Done:
    """Result of a task."""

    episodes: int
    seconds: float  #: simulated [s]
    kept: bool  #: the shard existed already and was intact


def data_path(split: str, number: int) -> str:
    """Path of a shard's samples in the dataset's folder."""
    return f"data/{split}-{number:06d}.parquet"


def manifest_path(split: str, number: int) -> str:
    """Path of a shard's list of episodes, one JSON line each; written after the samples."""
    return f"manifest/{split}-{number:06d}.jsonl"


def make_shard(task: ShardTask) -> Done:
    """Simulate and write a shard, unless it exists and is intact.

    Raises:
        FileError: this installation or machine computes other bytes than the one that started the
            command, or an arm's file has changed.
        OSError: the shard cannot be written.
    """
    if code() != task.code:
        raise FileError(
            "a worker has other code, or rounds differently, than the command that started it: "
            "install the same versions on all machines, and use one kind of processor"
        )
    configuration = Configuration.from_json(task.configuration)
    split = next(s for s in configuration.splits if s.name == task.split)
    each, first = configuration.episodes_per_shard, task.number * configuration.episodes_per_shard
    numbers = range(first, min(first + each, split.episodes))
    folder = Path(task.folder)
    kept = fault(folder, task.split, task.number) is None
    if not kept:
        episodes = [planned(configuration, split, n) for n in numbers]
        for arm in {one.arm for one in episodes}:
            check_unchanged(arm, configuration.robots)
        _write(folder, task, configuration, episodes)
    return Done(len(numbers), len(numbers) * split.seconds, kept)


def fault(folder: Path, split: str, number: int) -> str | None:
    """The fault of a shard, or None if every byte is as written."""
    data, listed = folder / data_path(split, number), folder / manifest_path(split, number)
    if not listed.is_file():
        return "missing" if not data.exists() else "not listed in the manifest"
    try:
        lines = read_lines(listed)
    except ValueError:
        return "its manifest is damaged"
    if not data.is_file():
        return "its samples are missing"
    if digest(data) != lines[0]["sha256"]:
        return f"damaged: {data.stat().st_size} bytes, not those that were written"
    return None


def read_lines(path: Path) -> list[dict[str, Any]]:
    """The lines of one file of the manifest.

    Raises:
        FileError: the file is damaged.
    """
    *lines, last, end = [b""] * 2 + path.read_bytes().split(b"\n")  # at least three
    lines = lines[2:]
    check = hashlib.sha256(b"".join(line + b"\n" for line in lines)).hexdigest()
    written = json.dumps({"sha256_of_lines": check}).encode()
    found: list[dict[str, Any]] = []
    if lines and last == written and end == b"":
        with contextlib.suppress(ValueError, RecursionError):
            found = [json.loads(line) for line in lines]
    if not found:
        raise FileError(
            f"{path}: damaged, its checksum does not fit; the same `tauguard generate` that made "
            "the dataset makes it again"
        )
    return found


def digest(path: Path) -> str:
    """SHA-256 of a file."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _write(
    folder: Path, task: ShardTask, configuration: Configuration, episodes: list[Planned]
) -> None:
    data = folder / data_path(task.split, task.number)
    with atomic_file(data) as stream:
        lines = _write_episodes(stream, configuration, episodes, task.code)
    common = {
        "shard": data_path(task.split, task.number),
        "bytes": data.stat().st_size,
        "sha256": digest(data),
    }
    text = "".join(json.dumps({**line, **common}, sort_keys=True) + "\n" for line in lines)
    check = {"sha256_of_lines": hashlib.sha256(text.encode()).hexdigest()}
    write_atomic(folder / manifest_path(task.split, task.number), text + json.dumps(check) + "\n")


def _write_episodes(
    stream: BinaryIO, configuration: Configuration, episodes: list[Planned], code_hash: str
) -> list[dict[str, Any]]:
    """Write the samples, one row group per episode; returns the episodes' manifest lines."""
    like = schema(configuration.most_joints, configuration.residual)
    lines, groups = [], 0
    with pq.ParquetWriter(stream, like, **writing(like)) as writer:
        for one, trace, residual, outcome in _simulated(configuration, episodes):
            line = _line(one, trace, outcome, configuration.joints_of(one.arm))
            line["key"] = one.key(configuration, code_hash)
            line["row_group"] = groups if line["rows"] else None
            if trace is not None:
                writer.write_table(table(trace, one.number, residual, like), len(trace.t))
                groups += 1
            lines.append(line)
        text = json.dumps({"format": 1, "episodes": lines}, sort_keys=True)
        writer.add_key_value_metadata({"tauguard": text})
    return lines


def writing(like: pa.Schema) -> dict[str, Any]:
    """Options of pyarrow's ``ParquetWriter`` for a shard of this schema."""
    floats = [field.name for field in like if pa.types.is_floating(field.type)]
    return {
        "compression": "zstd",
        "compression_level": ZSTD_LEVEL,
        "use_dictionary": [name for name in like.names if name not in floats],
        "use_byte_stream_split": floats,
        "write_page_checksum": True,
    }


def _simulated(
    configuration: Configuration, episodes: list[Planned]
) -> Iterator[tuple[Planned, Trace | None, Array | None, str]]:
    every = PHYSICS_RATE // configuration.rate
    for one in episodes:
        try:
            trace, residual = simulated(one, configuration.residual)
        except (SimulationDiverged, ValueError) as error:
            yield one, None, None, f"failed: {' '.join(str(error).split())}"
            continue
        happened, wanted = len(given(trace.truth).collisions), len(one.episode.collisions)
        outcome = "as planned"
        if happened != wanted:
            outcome = f"{happened} of {wanted} planned collisions happened"
            outcome += "".join(f"; {why}" for why in trace.meta.get("missed", "").splitlines())
        rows = None if residual is None else rounded(RESIDUAL, residual[::every])
        yield one, stored(trace, every), rows, outcome


def simulated(one: Planned, with_residual: bool) -> tuple[Trace, Array | None]:
    """An episode at the rate of the physics, with the observer's residual (T, n) if wanted."""
    simulation = Simulation(replace(one.episode, arm=one.source or one.arm))
    trace = simulation.run()
    if not with_residual:
        return trace, None
    robot = RobotNumbers.from_pin(pin_model(simulation.scene.arm_xml))
    return trace, residual_of(trace, robot, simulation.nominal)


def residual_of(trace: Trace, robot: RobotNumbers, drive: Drive) -> Array:
    """The momentum observer's estimate of tau_ext [N m], (T, n), with the nominal numbers."""
    tau = drive.gain * trace.current
    if drive.friction is not None:
        tau = tau - drive.friction.coulomb * np.tanh(trace.qd / STANDSTILL)
        tau = tau - drive.friction.viscous * trace.qd
    return observe(robot, trace.t, trace.q, trace.qd, tau, OBSERVER_GAIN, threads=1)


def _line(
    one: Planned, trace: Trace | None, outcome: str, joints: tuple[str, ...]
) -> dict[str, Any]:
    episode = one.episode
    collisions = () if trace is None else given(trace.truth).collisions
    return {
        "split": one.split,
        "number": one.number,
        "arm": one.arm,
        "individual": one.individual,
        "seed": episode.seed,
        "speed": episode.speed,
        "payload_g": max([episode.payload_g, *(pick.payload_g for pick in episode.picks)]),
        "temperature": episode.temperature,
        "seconds": episode.seconds,
        "rows": 0 if trace is None else len(trace.t),
        "joints": list(joints),
        "outcome": outcome,
        "planned_collisions": len(episode.collisions),
        "collisions": [collision_line(c) for c in collisions],
        "config_sha256": episode.config_hash,
        "model_sha256": None if trace is None else trace.meta["model_sha256"],
        "episode": _plain(asdict(episode)),
    }


def _plain(values: Mapping[str, Any]) -> Any:
    return json.loads(json.dumps(values))
