"""Generation of datasets: speed compared with ``mujoco.rollout``, size, reading speed."""

import io
import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq

from oracles.bare_physics import rollout_pieces
from oracles.processor_time import clock, count_time
from studies.framework import table_rows, time_in_turn
from tauguard.datasets import columns_of_shards
from tauguard.datasets.columns_of_shards import RESIDUAL, rounded, schema, stored
from tauguard.datasets.configuration import load_configuration
from tauguard.datasets.generation import generate_dataset
from tauguard.datasets.schedule import Planned, planned
from tauguard.datasets.shard import residual_of, writing
from tauguard.detectors import RobotNumbers
from tauguard.envs import Simulation
from tauguard.models import pin_model
from tauguard.report import Row

NAME = "tauguard-collisions-v1"
PARTS = ("prepare", "targets", "steps", "labels", "observer", "writing")  #: of the work, in order
RATES = (1000, 500, 100)  #: sample rates at which a dataset's size is measured [Hz]
NOTES = {
    "rate": "Episodes of tauguard-collisions-v1 under another seed; processor time of one core, 1 "
    "kHz, observer and writing included. us: each part, per sample; steps include the attempts at "
    "a collision until its severity is the one asked for. rollout: mujoco.rollout on the same "
    "scene from the same states, without drives, controller, contacts or labels; its joints differ "
    "from the motion by `rollout away` after 0.1 s.",
    "size": "MB (1e6 bytes) an hour of tauguard-collisions-v1 under another seed.",
    "read": "one column of one shard by pyarrow, MB of float32 a second, median of 7.",
}


def measure(quick: bool, seed: int) -> list[Row]:
    """All rows; the quick run has few episodes."""
    return rate_rows(quick, seed) + size_rows(quick, seed)


def draw(rows: list[Row], figure: Any) -> None:
    """Time of each part for one sample, and of mujoco.rollout alone."""
    own = [row for row in table_rows(rows, "rate") if "steps [us]" in row]
    axes, left = figure.subplots(), np.zeros(len(own))
    names = [row["episodes"] for row in own]
    for part in PARTS:
        width = np.array([row[f"{part} [us]"] for row in own])
        axes.barh(names, width, 0.4, left=left, label=part)
        left = left + width
    axes.plot([row["rollout [us]"] for row in own], names, "kD", label="mujoco.rollout")
    axes.set(xlabel="microseconds per sample", ylabel="episodes")
    axes.legend()


def rate_rows(quick: bool, seed: int) -> list[Row]:
    """Time per sample in episodes without and with collisions, and the rate for half of each.

    The seed was not used in development. A full run takes four episodes of each kind from the first
    split and four from the last, whose arm is not in the first. A quick run takes one of each kind
    from the first.
    """
    configuration = replace(load_configuration(NAME), seed=987_000 + seed)
    count = 1 if quick else 4
    first, *_, last = configuration.splits
    splits = (first,) if quick else (first, last)
    rows: list[Row] = []
    for kind in ("free", "struck"):
        found = []
        for split in splits:
            every = (planned(configuration, split, n) for n in range(split.episodes))
            fitting = (one for one in every if bool(one.episode.collisions) == (kind == "struck"))
            found += [timed_parts(next(fitting)) for _ in range(count)]
        samples = sum(one["samples"] for one in found)
        us = {p: 1e6 * sum(one[p] for one in found) / samples for p in (*PARTS, "rollout")}
        whole = sum(us[part] for part in PARTS)
        each = [one["samples"] / 1000 / sum(one[p] for p in PARTS) for one in found]
        row: Row = {"study": "rate", "episodes": kind, "n": len(found)}
        row |= {"x real time a core": 1000 / whole, "least": min(each), "most": max(each)}
        row |= {f"{part} [us]": value for part, value in us.items()}
        row |= {"rollout / ours": us["rollout"] / whole}
        rows.append(row | {"rollout away [rad]": max(one["error"] for one in found)})
    mixed = 2 / sum(1 / row["x real time a core"] for row in rows)
    half: Row = {"study": "rate", "episodes": "half struck", "x real time a core": mixed}
    return [*rows, half | {"hours a minute, 2 cores": mixed * 2 / 60}]


def timed_parts(one: Planned) -> dict[str, float]:
    """Processor time of each part and of the rollout [s], and the samples, of one episode."""
    spent = dict.fromkeys(PARTS, 0.0)
    with clock(spent, "prepare"):
        simulation = Simulation(one.episode)
    striking: Any = simulation.striking
    for loop in {simulation.loop, striking.loop}:
        count_time(spent, "steps", loop, "run")
    count_time(spent, "targets", striking._aim, "find")
    with clock(spent, "labels"):
        trace = simulation.run()
    spent["labels"] -= spent["steps"] + spent["targets"]
    with clock(spent, "observer"):
        robot = RobotNumbers.from_pin(pin_model(simulation.scene.arm_xml))
        residual = residual_of(trace, robot, simulation.nominal)
    like = schema(len(trace.joint_names), True)
    with clock(spent, "writing"):
        rows = stored(trace, 1)
        shard = columns_of_shards.table(rows, one.number, rounded(RESIDUAL, residual), like)
        with pq.ParquetWriter(io.BytesIO(), like, **writing(like)) as writer:
            writer.write_table(shard, len(trace.t))
    seen: Any = simulation._rollout
    peer, error = rollout_pieces(simulation, seen.q, seen.qd)
    return {**spent, "rollout": peer, "error": error, "samples": float(len(trace.t))}


def size_rows(quick: bool, seed: int) -> list[Row]:
    """MB an hour with and without residual, and the rate of reading one column."""
    whole, rows = load_configuration(NAME), []
    split = replace(whole.splits[0], episodes=12)
    if quick:
        split = replace(split, episodes=1, seconds=20.0, collisions=5)
    for rate, residual in ((rate, residual) for rate in RATES for residual in (False, True)):
        asked = replace(whole, seed=seed, rate=rate, residual=residual, splits=(split,))
        with tempfile.TemporaryDirectory() as folder:
            generate_dataset(asked, Path(folder) / "made", workers=1)
            files = sorted(Path(folder).glob("made/data/*.parquet"))
            size = sum(path.stat().st_size for path in files) / 1e6
            name = f"{rate} Hz{', residual' if residual else ''}"
            rows.append({"study": "size", "rows a second": name, "MB an hour": size / asked.hours})
            if rate == max(RATES) and residual:
                n = pq.ParquetFile(files[0]).metadata.num_rows
                call = {"read": partial(pq.read_table, files[0], columns=["current_2"])}
                seconds = time_in_turn(call, repeats=7)["read"]["median"]
                read = {"study": "read", "rows": n, "pyarrow [MB/s]": 4e-6 * n / seconds}
    return [*rows, read]
