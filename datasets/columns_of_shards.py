"""The columns of a dataset's Parquet files: one row per sample, one row group per episode."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.traces import Collision, Trace, Truth

#: Signals of the joints: column ``q_1`` and so on, float32.
JOINT_SIGNALS = ("q", "qd", "current", "q_des", "qd_des", "qdd_des", "tau_ext")
#: The momentum observer's estimate, if the configuration has ``residual = true``.
RESIDUAL = "residual"
#: Step to which a signal is rounded; this makes files a third smaller. A step is a power of two, so
#: that float32 represents multiples exactly, and is below the resolution of the sensors (2e-6 rad,
#: 5e-4 rad/s, 2.24 mA). Other signals are stored in single precision without rounding.
RESOLUTION = {
    "q": 2.0**-22,
    "qd": 2.0**-18,
    "current": 2.0**-14,
    "q_des": 2.0**-22,
    "qd_des": 2.0**-20,
    "qdd_des": 2.0**-16,
    RESIDUAL: 2.0**-12,
}
POINT = ("contact_x", "contact_y", "contact_z")
FORCE = ("force_x", "force_y", "force_z")
#: What each column means, with its unit.
MEANING = {
    "episode": "number of the episode within its split",
    "t": "time since the episode's start [s]",
    "q": "measured joint positions [rad]",
    "qd": "measured joint velocities [rad/s]",
    "current": "measured motor currents [A]",
    "q_des": "commanded joint positions [rad]",
    "qd_des": "commanded joint velocities [rad/s]",
    "qdd_des": "commanded joint accelerations [rad/s^2]",
    "tau_ext": "true torque of contacts and pushes at the joints [N m]",
    "residual": "momentum observer's estimate of tau_ext with nominal numbers [N m]",
    "contact_force": "norm of the net external contact force on the arm [N]",
    "contact_link": "link of the largest contact force, 1-based, 0 for none",
    "contact_x": "point of that contact, world frame [m], null without contact (also _y, _z)",
    "force_x": "force of that contact on the arm, world frame [N] (also _y, _z)",
    "payload": "mass carried, not known to the observer [kg]",
    "collision": "index into the episode's collisions in the manifest, -1 for none",
}


def schema(joints: int, residual: bool) -> pa.Schema:
    """Schema of every shard; columns of joints that an arm lacks are null."""
    signals = (*JOINT_SIGNALS, RESIDUAL) if residual else JOINT_SIGNALS
    single = ("contact_force", *POINT, *FORCE, "payload")
    return pa.schema(
        [
            pa.field("episode", pa.int32(), nullable=False),
            pa.field("t", pa.float64(), nullable=False),
            *(pa.field(f"{s}_{i}", pa.float32()) for s in signals for i in range(1, joints + 1)),
            pa.field("contact_link", pa.int8(), nullable=False),
            *(pa.field(name, pa.float32()) for name in single),
            pa.field("collision", pa.int16(), nullable=False),
        ]
    )


def stored(trace: Trace, every: int) -> Trace:
    """The part of a trace that a shard stores: each ``every``-th sample, in single precision.

    Collision labels keep the time resolution of the physics. Obstacle poses and checker contacts
    are left out; an MCAP recording of the episode has them.
    """
    rows = slice(None, None, every)

    def single(x: Array) -> Array:
        return x[rows].astype(np.float32).astype(np.float64)

    truth = trace.truth
    if truth is not None:
        names = "tau_ext", "contact_force", "payload", "contact_point", "contact_vector"
        arrays: dict[str, Any] = {name: single(getattr(truth, name)) for name in names}
        arrays["contact_link"] = truth.contact_link[rows].copy()
        truth = Truth(collisions=truth.collisions, **arrays)
    signals: dict[str, Any] = {n: single(rounded(n, x)) for n, x in trace.signals.items()}
    signals |= {"meta": trace.meta, "attachments": trace.attachments}
    return Trace(trace.joint_names, trace.t[rows].copy(), truth=truth, **signals)


def rounded(name: str, signal: Array) -> Array:
    """A signal rounded to its :data:`RESOLUTION`."""
    step = RESOLUTION[name]
    return np.rint(signal / step) * step


def table(trace: Trace, number: int, residual: Array | None, like: pa.Schema) -> pa.Table:
    """The rows of a shard for episode ``number``, as a table with the columns of ``like``."""
    truth = given(trace.truth)
    rows, joints = trace.q.shape
    wide = {name: getattr(trace, name) for name in JOINT_SIGNALS if name != "tau_ext"}
    wide |= {"tau_ext": truth.tau_ext, RESIDUAL: residual}
    single: dict[str, Any] = {
        "episode": np.full(rows, number, np.int32),
        "t": trace.t,
        "contact_force": truth.contact_force,
        "contact_link": truth.contact_link.astype(np.int8),
        "payload": truth.payload,
        "collision": collision_index(trace.t, truth.collisions),
        **dict(zip(POINT, truth.contact_point.T, strict=True)),
        **dict(zip(FORCE, truth.contact_vector.T, strict=True)),
    }
    columns = []
    for field in like:
        signal, _, joint = field.name.rpartition("_")
        if field.name in single:
            values = single[field.name]
        elif wide[signal] is None or int(joint) > joints:
            columns.append(pa.nulls(rows, field.type))
            continue
        else:
            values = wide[signal][:, int(joint) - 1]
        columns.append(_column(values, field.type, field.name in POINT))
    return pa.Table.from_arrays(columns, schema=like)


def _column(values: Array, kind: pa.DataType, gaps: bool) -> pa.Array:
    """A column; with ``gaps``, NaN becomes null. (``pa.array`` would import pandas.)"""
    values = np.ascontiguousarray(values, kind.to_pandas_dtype())
    known = np.packbits(~np.isnan(values), bitorder="little") if gaps else None
    buffers = [None if x is None else pa.py_buffer(x) for x in (known, values)]
    return pa.Array.from_buffers(kind, len(values), buffers)


def trace_of(rows: pa.Table, line: Mapping[str, Any], attachments: Mapping[str, str]) -> Trace:
    """The inverse of :func:`table`.

    Args:
        rows: rows of one episode.
        line: the episode's line of the manifest.
        attachments: the texts of :func:`tauguard.datasets.dataset_folder.arm_texts`.
    """
    names = tuple(line["joints"])

    def column(name: str) -> Array:
        values = rows.column(name).to_numpy(zero_copy_only=False)
        return np.asarray(values, np.float64)

    def wide(signal: str) -> Array:
        return np.stack([column(f"{signal}_{i}") for i in range(1, len(names) + 1)], axis=1)

    truth = Truth(
        tau_ext=wide("tau_ext"),
        contact_force=column("contact_force"),
        collisions=tuple(collision_of(c) for c in line["collisions"]),
        payload=column("payload"),
        contact_link=rows.column("contact_link").to_numpy().astype(np.int64),
        contact_point=np.stack([column(name) for name in POINT], axis=1),
        contact_vector=np.stack([column(name) for name in FORCE], axis=1),
    )
    signals: dict[str, Any] = {name: wide(name) for name in JOINT_SIGNALS if name != "tau_ext"}
    meta = {name: str(line[name]) for name in ("key", "split", "arm", "individual", "speed")}
    return Trace(
        joint_names=names,
        t=column("t"),
        truth=truth,
        meta={**meta, "episode": f"{line['split']}/{line['number']}", "seed": str(line["seed"])},
        attachments=attachments,
        **signals,
    )


def collision_index(t: Array, collisions: tuple[Collision, ...]) -> NDArray[np.int16]:
    """Index of the collision at each sample, -1 for none, shape (T,)."""
    found = np.full(len(t), -1, np.int16)
    for i, one in enumerate(collisions):
        found[(t >= one.onset) & (t <= one.end)] = i
    return found


def collision_line(one: Collision) -> dict[str, Any]:
    """A collision as JSON values; :func:`collision_of` is the inverse."""
    return {
        "kind": one.kind,
        "onset": one.onset,
        "end": one.end,
        "link": one.link,
        "point": one.point.tolist(),
        "force": one.force.tolist(),
        "peak_tau": one.peak_tau,
    }


def collision_of(values: Mapping[str, Any]) -> Collision:
    """The inverse of :func:`collision_line`."""
    arrays = {name: np.array(values[name], np.float64) for name in ("point", "force")}
    return Collision(**{**values, **arrays})


def given(value: Any) -> Any:
    """``value``, which is not None (for the type checker)."""
    assert value is not None
    return value
