"""Read MCAP logs: tauguard's recordings, and ``sensor_msgs/msg/JointState`` of other programs."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from mcap.exceptions import McapError
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.datasets.log_checks import checked, unwrapped
from tauguard.findings import LogError, note
from tauguard.traces.logs import Log
from tauguard.traces.mcap import decode
from tauguard.traces.mcap_container import Contents
from tauguard.traces.trace import Trace

TYPE = "sensor_msgs/msg/JointState"


def read_joint_states(path: Path, joint_names: Sequence[str] | None, torque: bool = False) -> Log:
    """A trace from the first topic of type JointState.

    Its ``effort`` is taken as current [A], with ``torque`` as joint torque [N m].

    Raises:
        LogError: no such topic, messages without velocity or effort, or a message that lacks a
            joint of the first one.
    """
    try:
        contents = Contents(path.read_bytes())
        contents.check_sum()
    except (McapError, struct.error) as error:
        raise LogError(f"not a whole MCAP file: {error or 'it is cut off'}") from error
    if "tauguard.trace" in contents.metadata:
        trace = _of_effort(decode(contents), torque)
        return Log(trace, findings=checked(trace, lambda row: f"sample {row}"))
    topic, messages = _messages(contents)
    trace = _of_effort(assemble(topic, messages, joint_names), torque)
    meaning = "joint torque [N m]" if torque else "taken as current [A]"
    q, jumps = unwrapped(trace.q, trace.joint_names, lambda row: f"{topic}, message {row}")
    trace = replace(trace, q=q) if jumps else trace
    notes = [note("effort", f"{topic}: effort is {meaning}"), *jumps]
    findings = checked(trace, lambda row: f"{topic}, message {row}", notes)
    return Log(trace, as_read=f"{topic}, effort {meaning}", findings=findings)


def _of_effort(trace: Trace, torque: bool) -> Trace:
    return replace(trace, meta={**trace.meta, "effort": "torque"}) if torque else trace


def _messages(contents: Contents) -> tuple[str, list[tuple[int, bytes]]]:
    """Name, log times and messages of the first topic of the type, in the order of time."""
    schemas, channels = contents.schemas, contents.channels.values()
    types = {c.topic: getattr(schemas.get(c.schema_id), "name", "?") for c in channels}
    topic = next((name for name, kind in types.items() if kind == TYPE), None)
    if topic is None:
        have = ", ".join(f"{name} ({kind})" for name, kind in types.items())
        raise LogError(f"no topic of type {TYPE}; topics: {have or 'none'}")
    own = {c.id for c in channels if c.topic == topic}
    messages = [
        (int(time), row.tobytes())
        for block in contents.messages()
        if block.channel in own
        for time, row in zip(block.nanoseconds, block.payload, strict=True)
    ]
    counted = sum(contents.counts.get(number, 0) for number in own)
    if contents.counts and counted != len(messages):
        raise LogError(
            f"{topic}: {len(messages)} messages, but the file's summary counts {counted}: "
            "damaged, or cut"
        )
    return topic, sorted(messages, key=lambda message: message[0])


def assemble(
    topic: str, messages: Sequence[tuple[int, bytes]], joint_names: Sequence[str] | None
) -> Trace:
    """Make a trace of the messages; times are header stamps, or log times where a stamp is 0."""
    if len(messages) < 2:
        raise LogError(f"{topic}: {len(messages)} messages, expected at least 2")
    rows = [joint_state(f"{topic}, message {k}", data) for k, (_, data) in enumerate(messages)]
    names = list(joint_names or rows[0]["name"])
    signals: dict[str, list[Any]] = {"position": [], "velocity": [], "effort": []}
    times = np.empty(len(rows))
    for k, ((log_time, _), row) in enumerate(zip(messages, rows, strict=True)):
        missing = [name for name in names if name not in row["name"]]
        if missing:
            raise LogError(
                f"{topic}, message {k}: no joint {missing[0]!r}; it has {', '.join(row['name'])}"
            )
        order = [row["name"].index(name) for name in names]
        for key, values in signals.items():
            if len(row[key]) != len(row["name"]):
                raise LogError(f"{topic}, message {k}: {key} holds {len(row[key])} numbers")
            values.append(row[key][order])
        times[k] = 1e-9 * (row["stamp"] or log_time)
    return Trace(
        joint_names=tuple(names),
        t=times,
        q=np.array(signals["position"]),
        qd=np.array(signals["velocity"]),
        current=np.array(signals["effort"]),
        meta={"topic": topic},
    )


def joint_state(where: str, data: bytes) -> dict[str, Any]:
    """The fields of one CDR-encoded JointState.

    Raises:
        LogError: a message that ends too early or is not CDR version 1.
    """
    if len(data) < 4 or data[:2] not in (b"\0\1", b"\0\0"):
        raise LogError(f"{where}: not plain CDR")
    order = "<" if data[1] == 1 else ">"
    body, at = data[4:], 0

    def values(kind: str, count: int) -> NDArray[Any]:
        nonlocal at
        at += -at % np.dtype(kind).itemsize if count else 0
        found = np.frombuffer(body, order + kind, count, at)
        at += found.nbytes
        return found

    def scalar() -> int:
        return int(values("u4", 1)[0])

    def text() -> str:
        return values("u1", scalar()).tobytes()[:-1].decode()

    def doubles() -> Array:
        return values("f8", scalar()).astype(np.float64)

    try:
        stamp = scalar() * 10**9 + scalar()
        text()
        names = [text() for _ in range(scalar())]
        position, velocity, effort = doubles(), doubles(), doubles()
    except ValueError as error:
        raise LogError(f"{where}: cut off ({len(data)} bytes)") from error
    return {
        "stamp": stamp,
        "name": names,
        "position": position,
        "velocity": velocity,
        "effort": effort,
    }
