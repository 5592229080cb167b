"""Conversion of published logs into the layout that tauguard's column presets read.

Every conversion takes the contents of the originals in the order of the manifest and returns the
bytes of one CSV file. Numbers are written with fixed formats, so that the bytes are the same on
every machine.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from tauguard.arrays import Array
from tauguard.findings import FileError

Conversion = Callable[[Sequence[bytes]], bytes]


def same(originals: Sequence[bytes]) -> bytes:
    """The original as it is."""
    return originals[0]


def ur10e_pushed(originals: Sequence[bytes]) -> bytes:
    """UR10e: of a table without header, time from 0, positions, velocities and currents."""
    (table,) = originals
    rows = [[float(cell) for cell in cells[:19]] for cells in _cells(table)]
    begin = rows[0][0]
    kept = ([f"{row[0] - begin:.7g}", *(f"{x:.7g}" for x in row[1:])] for row in rows)
    return _csv(["t", *_names(6, "q", "qd", "i")], kept)


def ur5(originals: Sequence[bytes]) -> bytes:
    """UR5: six tables joined by row, and the force sensor's table with its clock, if there is one.

    A table's last row may be cut off; the shortest table decides. The force is interpolated to the
    arm's times and its mean over the first 100 rows is subtracted.
    """
    tables = [_cells(table) for table in originals[:6]]
    for table in tables:
        while len(table[-1]) < 7:
            table.pop()
    length = min(map(len, tables))
    if any(len(row) != 7 for table in tables for row in table[:length]):
        raise FileError("a row that is not the last one has fewer than 7 numbers")
    header = ["t", *_names(6, "q", "qd", "i", "i_target", "m_target")]
    rows = [
        [f"{float(parts[0][0]):.4f}", *(f"{float(x):.5f}" for part in parts[:5] for x in part[1:])]
        for parts in zip(*(table[:length] for table in tables), strict=True)
    ]
    if len(originals) > 6:
        header += ["Fx", "Fy", "Fz", "Tx", "Ty", "Tz"]
        force = _force(np.array([float(row[0]) for row in rows]), originals[6:])
        rows = [[*row, *(f"{x:.4f}" for x in at)] for row, at in zip(rows, force, strict=True)]
    return _csv(header, rows)


def _force(t: Array, sensor: Sequence[bytes]) -> Array:
    """Force and torque of the sensor at the arm's times ``t`` [s], shape (T, 6).

    ``sensor`` has the table, and the start of the clocks of sensor and arm.
    """
    measured = np.array([[float(cell) for cell in row] for row in _cells(sensor[0])])
    later = float(sensor[1].split()[0]) - float(sensor[2].split()[0])
    columns = [np.interp(t, measured[:, 0] + later, measured[:, k]) for k in range(1, 7)]
    force: Array = np.column_stack(columns)
    force -= force[:100].mean(axis=0)
    return force


def kuka_med7(originals: Sequence[bytes]) -> bytes:
    """LBR Med 7: tables of positions, velocities and torques, their joints in the arm's order."""
    positions, velocities, efforts = map(_cells, originals)
    names = positions[0]
    at = [names.index(f"lbr_joint_{joint}") for joint in range(7)]
    rows, begin = [], float(positions[1][0])
    for parts in zip(positions[1:], velocities[1:], efforts[1:], strict=True):
        if len({part[0] for part in parts}) > 1:
            raise FileError(f"the tables differ in time: {', '.join(part[0] for part in parts)}")
        numbers = [float(part[k]) for part in parts for k in at]
        rows.append([f"{float(parts[0][0]) - begin:.7g}", *(f"{x:.7g}" for x in numbers)])
    return _csv(["t", *_names(7, "q", "qd", "effort")], rows)


def panda_touch(originals: Sequence[bytes]) -> bytes:
    """Panda: time, joint torques, external torques, positions, velocities and the label."""
    names, *table = _cells(originals[0])
    signals = [f"{name}{joint}" for name in ("tau_J", "tau_ext", "q", "dq") for joint in range(7)]
    header = ["time", *signals, "label"]
    at = [names.index(name) for name in header]
    rows = (
        [f"{round(float(row[at[0]]), 5):.7g}", *(f"{float(row[k]):.7g}" for k in at[1:])]
        for row in table
    )
    return _csv(header, rows)


def ur3(originals: Sequence[bytes]) -> bytes:
    """UR3: the joint states of a ROS 1 bag, with torques of the URDF's sign and time from 0."""
    states = list(_joint_states(originals[0]))
    begin = states[0][0]
    rows = (
        [f"{x:.6f}" for x in (t - begin, *q, *qd, *(-tau for tau in effort))]
        for t, q, qd, effort in states
    )
    return _csv(["t", *_names(6, "q", "qd", "tau")], rows)


#: The conversions by their names in the manifest.
CONVERSIONS: dict[str, Conversion] = {
    conversion.__name__: conversion
    for conversion in (same, ur10e_pushed, ur5, kuka_med7, panda_touch, ur3)
}

# -- CSV -------------------------------------------------------------------------------------------


def _cells(table: bytes) -> list[list[str]]:
    return [line.split(",") for line in table.decode().splitlines()]


def _names(joints: int, *signals: str) -> list[str]:
    return [f"{signal}{joint}" for signal in signals for joint in range(1, joints + 1)]


def _csv(header: Sequence[str], rows: Sequence[Sequence[str]] | Iterator[Sequence[str]]) -> bytes:
    return "".join(",".join(row) + "\n" for row in (header, *rows)).encode()


# -- ROS 1 bags ------------------------------------------------------------------------------------

#: Bag format 2.0: http://wiki.ros.org/Bags/Format/2.0. Operations of records.
MESSAGE, CHUNK = b"\x02", b"\x05"
MAGIC = b"#ROSBAG V2.0\n"

State = tuple[float, tuple[float, ...], tuple[float, ...], tuple[float, ...]]


def _joint_states(bag: bytes) -> Iterator[State]:
    """Time [s], position, velocity and effort of every message, in the order of their recording."""
    if not bag.startswith(MAGIC):
        raise FileError("not a ROS 1 bag of version 2.0")
    messages: list[tuple[tuple[int, ...], bytes]] = []
    for head, data in _records(bag, len(MAGIC)):
        if head[b"op"] != CHUNK:
            continue
        if head[b"compression"] != b"none":
            raise FileError(f"a chunk with compression {head[b'compression'].decode()}")
        inner = _records(data, 0)
        messages += [(struct.unpack("<II", h[b"time"]), d) for h, d in inner if h[b"op"] == MESSAGE]
    for _, data in sorted(messages, key=lambda message: message[0]):
        yield _joint_state(data)


def _records(content: bytes, at: int) -> Iterator[tuple[dict[bytes, bytes], bytes]]:
    while at < len(content):
        header, at = _sized(content, at)
        data, at = _sized(content, at)
        fields, place = {}, 0
        while place < len(header):
            field, place = _sized(header, place)
            name, _, value = field.partition(b"=")
            fields[name] = value
        yield fields, data


def _sized(content: bytes, at: int) -> tuple[bytes, int]:
    """The bytes after a 32-bit length at ``at``, and the place after them."""
    (length,) = struct.unpack_from("<I", content, at)
    return content[at + 4 : at + 4 + length], at + 4 + length


def _joint_state(message: bytes) -> State:
    """``sensor_msgs/JointState``: header (sequence, stamp, frame), names and three arrays."""
    _, seconds, nanoseconds = struct.unpack_from("<III", message)
    _, at = _sized(message, 12)
    (names,) = struct.unpack_from("<I", message, at)
    at += 4
    for _ in range(names):
        _, at = _sized(message, at)
    arrays = []
    for _ in range(3):
        (count,) = struct.unpack_from("<I", message, at)
        arrays.append(struct.unpack_from(f"<{count}d", message, at + 4))
        at += 4 + 8 * count
    return seconds + nanoseconds * 1e-9, arrays[0], arrays[1], arrays[2]
