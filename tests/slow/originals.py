"""Writes a small intact file of every format: damaged files are made from them."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from tauguard.arrays import Array

COLUMNS = {"t": 0, "q": [1, 2], "qd": [3, 4], "current": [5, 6], "repair": ["nan"]}
JOINTS = ("one", "two")
ARM = """<mujoco><compiler angle="radian"/><worldbody><body name="a"><joint name="j" range="-1 1"/>
<geom size="0.1 0.2" type="capsule" mass="1"/><body name="b" pos="0 0 0.4"><joint name="k"
axis="1 0 0"/><geom size="0.1" mass="2"/></body></body></worldbody></mujoco>"""
URDF = """<robot name="two"><link name="base"/><link name="l"><inertial><mass value="1"/><inertia
ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link><joint name="j"
type="continuous"><parent link="base"/><child link="l"/><axis xyz="0 0 1"/></joint></robot>"""
SPLITS = """name = "small"
seed = 3
rate = 250
episodes_per_shard = 1
residual = false
[episodes]
seconds = 6.6
arms = ["cura6"]
speeds = [50]
payloads_g = [0]
severities = [[8, 64]]
[[splits]]
name = "train"
episodes = 1
quick_episodes = 1
individuals = [0]
"""
#: Where in the dataset's folder the damaged file belongs.
PLACES = {
    "shard": "data/train-000000.parquet",
    "manifest": "manifest/train-000000.jsonl",
    "head": "dataset.json",
    "dataset's arm": "arms/cura6.xml",
}


def _sines() -> tuple[Array, Array, Array]:
    t = np.arange(300, dtype=np.float64) * 0.01
    q = np.stack([np.sin(t), np.cos(t)], axis=1)
    return t, q, np.stack([np.cos(t), -np.sin(t)], axis=1)


def _write_table(path: Path) -> None:
    t, q, qd = _sines()
    np.savetxt(path, np.c_[t, q, qd, q], delimiter=",")


def _write_recording(path: Path) -> None:
    from tauguard.datasets import free_episodes
    from tauguard.envs import simulate
    from tauguard.traces import write_mcap

    write_mcap(path, simulate(free_episodes(0, 1, 2.0, (30.0,), (0.0,), None)[0]))


def _write_joint_states(path: Path) -> None:
    """As a ROS 2 system records them, by the library of that format."""
    from mcap.writer import Writer

    t, q, qd = _sines()
    with open(path, "wb") as stream:
        writer: Any = Writer(stream, 1 << 14)
        writer.start("ros2")
        schema = writer.register_schema("sensor_msgs/msg/JointState", "ros2msg", b"float64[] x")
        channel = writer.register_channel("/joint_states", "cdr", schema)
        for k, time in enumerate(t):
            data, stamp = _joint_state(float(time), q[k], qd[k]), round(1e9 * float(time))
            writer.add_message(channel, stamp, data, stamp, k)
        writer.finish()


def _joint_state(time: float, q: Array, qd: Array) -> bytes:
    """One message, CDR little-endian."""
    import struct

    nanoseconds = round(1e9 * time)
    body = struct.pack("<iII", nanoseconds // 10**9, nanoseconds % 10**9, 1) + b"\0"
    body += bytes(-len(body) % 4) + struct.pack("<I", len(JOINTS))
    for name in JOINTS:
        body += bytes(-len(body) % 4) + struct.pack("<I", len(name) + 1) + name.encode() + b"\0"
    for values in (q, qd, q):
        body += bytes(-len(body) % 4) + struct.pack("<I", len(values))
        body += bytes(-len(body) % 8) + struct.pack(f"<{len(values)}d", *values)
    return b"\0\1\0\0" + body


def _write_model(path: Path) -> None:
    from slow.small_detector import bare_arm
    from tauguard.datasets import free_episodes
    from tauguard.detectors import CollisionAlarm, save_model
    from tauguard.detectors.scores.currents import CurrentNetwork
    from tauguard.envs import simulate

    trace = simulate(free_episodes(0, 1, 4.0, (30.0,), (0.0,), None)[0])
    save_model(
        CollisionAlarm(CurrentNetwork(rows=500, epochs=2).fit([trace], bare_arm()), 3.0), path
    )


def _write_robot(path: Path) -> None:
    arm = path.with_name("arm.xml")
    arm.write_text(ARM)
    path.write_text('file = "arm.xml"\ntorque_limit = [100.0, 50.0]\nmax_speed = [2.0, 3.0]\n')


def _write_part(kind: str, path: Path) -> None:
    from tauguard.datasets.configuration import load_configuration
    from tauguard.datasets.generation import generate_dataset

    made = path.parent.parent / "made"  # one dataset serves all its files
    if not made.exists():
        text = path.parent.parent / "small.toml"
        text.write_text(SPLITS)
        generate_dataset(load_configuration(text), made, workers=1)
    shutil.copytree(made, path.parent / "dataset")
    shutil.copy(made / PLACES[kind], path)


def _write_rtde(path: Path) -> None:
    """What a controller sends: the answers of the handshake, a text message, then data."""
    from tauguard.live import rtde

    types = ("DOUBLE", "VECTOR6D", "VECTOR6D", "VECTOR6D")
    recipe, rng = rtde.Recipe(1, types), np.random.default_rng(0)
    parts = [
        rtde.packet(rtde.REQUEST_PROTOCOL_VERSION, b"\1"),
        rtde.packet(rtde.GET_URCONTROL_VERSION, bytes([0, 0, 0, 3] + [0] * 12)),
        rtde.packet(rtde.SETUP_OUTPUTS, b"\1" + ",".join(types).encode()),
        rtde.packet(rtde.START, b"\1"),
        rtde.text_message("robot", "begins", 3),
    ]
    parts += [recipe.pack([k * 0.008, *rng.normal(size=18)]) for k in range(60)]
    path.write_bytes(b"".join(parts))


WRITERS: dict[str, Callable[[Path], object]] = {
    "csv": _write_table,
    "lines": _write_table,
    "recording": _write_recording,
    "joint states": _write_joint_states,
    "columns": lambda path: path.write_text(json.dumps(COLUMNS)),
    "mjcf": lambda path: path.write_text(ARM),
    "urdf": lambda path: path.write_text(URDF),
    "robot": _write_robot,
    "configuration": lambda path: path.write_text(SPLITS),
    "model": _write_model,
    **{kind: partial(_write_part, kind) for kind in PLACES},
    "rtde": _write_rtde,
}
