"""Where the time of generation goes, beside a loop of ``mujoco.rollout`` over the same motions."""

from __future__ import annotations

import io
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pyarrow.parquet as pq
from mujoco import rollout

from tauguard.arrays import Array
from tauguard.datasets.columns_of_shards import RESIDUAL, rounded, schema, stored, table
from tauguard.datasets.configuration import load
from tauguard.datasets.schedule import Planned, planned
from tauguard.datasets.shard import residual_of, writing
from tauguard.detectors import RobotNumbers
from tauguard.envs import Simulation
from tauguard.envs.plant import untimed
from tauguard.models import pin_model
from tauguard.report import Row

#: The rollout's batches begin at states of the recorded motion this far apart [steps].
PIECE = 100
#: Parts of the work, in their order.
PARTS = ("prepare", "targets", "steps", "labels", "observer", "writing")


def rate_rows(quick: bool, seed: int) -> list[Row]:
    """Microseconds a sample of collision-free and of struck episodes, and of their mix.

    The episodes are those of ``tauguard-collisions-v1`` under another seed, so that nothing was
    developed on them; every arm of the first split and the arm of the last one take part.
    """
    configuration = replace(load("tauguard-collisions-v1"), seed=987_000 + seed)
    count = 1 if quick else 4
    splits = (
        configuration.splits[:1] if quick else (configuration.splits[0], configuration.splits[-1])
    )
    rows: list[Row] = []
    for kind in ("free", "struck"):
        chosen = []
        for split in splits:
            every = (planned(configuration, split, n) for n in range(split.episodes))
            fitting = (one for one in every if bool(one.episode.collisions) == (kind == "struck"))
            chosen += [next(fitting) for _ in range(count)]
        rows.append(_row(kind, [_timed(one) for one in chosen]))
    rows.append(_mix(rows[0], rows[1]))
    return rows


def _timed(one: Planned) -> dict[str, float]:
    """Processor seconds of each part, of the rollout, and simulated samples, of one episode."""
    spent = dict.fromkeys(PARTS, 0.0)
    with untimed():
        with _clock(spent, "prepare"):
            simulation = Simulation(one.episode)
        striking: Any = simulation.striking
        _count(spent, "steps", simulation.loop, "run")
        _count(spent, "targets", striking._aim, "find")
        with _clock(spent, "labels"):
            trace = simulation.run()
        spent["labels"] -= spent["steps"] + spent["targets"]
        with _clock(spent, "observer"):
            robot = RobotNumbers.from_pin(pin_model(simulation.scene.arm_xml))
            residual = residual_of(trace, robot, simulation.nominal)
        like = schema(len(trace.joint_names), True)
        with _clock(spent, "writing"):
            shard = table(stored(trace, 1), one.number, rounded(RESIDUAL, residual), like)
            with pq.ParquetWriter(io.BytesIO(), like, **writing(like)) as writer:
                writer.write_table(shard, len(trace.t))
    seen: Any = simulation._rollout
    peer, error = _rolled_out(simulation, seen.q, seen.qd)
    return {**spent, "rollout": peer, "error": error, "samples": float(len(trace.t))}


def _rolled_out(simulation: Simulation, q: Array, qd: Array) -> tuple[float, float]:
    """Processor seconds of ``mujoco.rollout`` over the same motion, and how far it gets from it.

    The same scene is stepped as often, in pieces that begin where the recorded motion was, under
    the feed-forward torques: without drives, friction, servo, recording of contacts or labels.
    """
    scene, model = simulation.scene, simulation.scene.model
    feed: Any = simulation._feed_forward
    pieces = len(q) // PIECE
    data = mujoco.MjData(model)
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    initial = np.empty((pieces, mujoco.mj_stateSize(model, kind)))
    for piece in range(pieces):
        data.qpos[scene.qpos_adr] = q[piece * PIECE]
        data.qvel[scene.dof_adr] = qd[piece * PIECE]
        mujoco.mj_getState(model, data, initial[piece], kind)
    control = np.zeros((pieces, PIECE, model.nv))
    control[:, :, scene.dof_adr] = feed[: pieces * PIECE].reshape(pieces, PIECE, -1)
    spec = int(mujoco.mjtState.mjSTATE_QFRC_APPLIED)
    began = time.process_time()
    states, _ = rollout.rollout(model, data, initial, control, control_spec=spec)
    spent = time.process_time() - began
    positions = states[:, -1, 1 + scene.qpos_adr]
    wanted = q[PIECE : pieces * PIECE + 1 : PIECE]
    return spent, float(np.abs(positions[: len(wanted)] - wanted).max(initial=0.0))


def _row(kind: str, timed: list[dict[str, float]]) -> Row:
    samples = sum(one["samples"] for one in timed)
    per = {p: 1e6 * sum(one[p] for one in timed) / samples for p in (*PARTS, "rollout")}
    whole = sum(per[part] for part in PARTS)
    each = [one["samples"] / 1000 / sum(one[p] for p in PARTS) for one in timed]
    return {
        "study": "rate",
        "episodes": kind,
        "n": len(timed),
        "x real time a core": 1000 / whole,
        "least": min(each),
        "most": max(each),
        **{f"{part} [us]": per[part] for part in PARTS},
        "rollout [us]": per["rollout"],
        "rollout / ours": per["rollout"] / whole,
        "rollout away [rad]": max(one["error"] for one in timed),
    }


def _mix(free: Row, struck: Row) -> Row:
    """Half of the samples from each."""
    rates = [float(str(row["x real time a core"])) for row in (free, struck)]
    mixed = 2 / sum(1 / rate for rate in rates)
    return {
        "study": "rate",
        "episodes": "half struck",
        "n": 0,
        "x real time a core": mixed,
        "hours a minute, 2 cores": mixed * 2 / 60,
    }


@contextmanager
def _clock(spent: dict[str, float], part: str) -> Iterator[None]:
    began = time.process_time()
    yield
    spent[part] += time.process_time() - began


def _count(spent: dict[str, float], part: str, owner: object, name: str) -> None:
    """Let a method of one object count the processor time that it takes."""
    method: Callable[..., object] = getattr(owner, name)

    def counted(*arguments: object, **options: object) -> object:
        with _clock(spent, part):
            return method(*arguments, **options)

    setattr(owner, name, counted)
