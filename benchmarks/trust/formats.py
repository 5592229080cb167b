"""Every format that tauguard reads: a small intact file, its reader, and who judges an answer.

A judge is the file's own checksum (the answer must be that of the intact file) or an independent
reading of the damaged text.
"""

from __future__ import annotations

import io
import json
import shutil
import tomllib
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

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


@dataclass(frozen=True)
class Format:
    """One kind of file."""

    ending: str
    read: Callable[[Path], Any]
    judge: Callable[[Path, Any, Any], str]  #: file, its answer, the intact file's; "" if right
    judged_by: str


def signals(trace: Any) -> list[Array]:
    """The measured signals of a trace."""
    return [trace.t, trace.q, trace.qd, trace.current]


def unchanged(path: Path, found: Any, intact: Any) -> str:
    """The file has a checksum: it answers as the intact one does, or not at all."""
    return "" if repr(plain(found)) == repr(plain(intact)) else "answers otherwise than intact"


def plain(value: Any) -> Any:
    """Arrays and dataclasses as something that can be compared by its text."""
    from dataclasses import fields, is_dataclass

    if isinstance(value, np.ndarray):
        return (value.dtype.str, value.shape, value.tobytes())
    if is_dataclass(value) and not isinstance(value, type):
        return [(f.name, plain(getattr(value, f.name))) for f in fields(value)]
    if isinstance(value, dict):
        return sorted((str(k), plain(v)) for k, v in value.items())
    return [plain(v) for v in value] if isinstance(value, list | tuple) else value


# -- readers ----------------------------------------------------------------------------------


def _csv(path: Path) -> Any:
    from tauguard.datasets import ColumnMap, read_log

    columns = ColumnMap(t=0, q=(1, 2), qd=(3, 4), current=(5, 6))
    return signals(read_log(path, columns).trace)


def _log(path: Path) -> Any:
    from tauguard.datasets import read_log

    return signals(read_log(path).trace)


def _recording(path: Path) -> Any:
    from tauguard.traces import read_mcap

    return read_mcap(path)


def _columns(path: Path) -> Any:
    from tauguard.datasets.columns import column_map

    return column_map(str(path))


def _robot(path: Path) -> Any:
    from tauguard.models.nominal import pin_model

    model = pin_model(path)
    return model.njoints - 1, sum(inertia.mass for inertia in model.inertias)


def _arm(path: Path) -> Any:
    from tauguard.models import Robot

    return Robot.from_toml(path)


def _configuration(path: Path) -> Any:
    from tauguard.datasets.configuration import load

    return load(path)


def _model(path: Path) -> Any:
    from tauguard.detectors import load_model

    return load_model(path)


def _mesh(path: Path) -> Any:
    from tauguard.cloth.scenes.recorded import read_mesh

    return read_mesh(path)


def _lines(path: Path) -> Any:
    from tauguard.datasets.live.lines import LineSource
    from tauguard.datasets.live.sample import SourceClosed

    found = []
    with open(path) as stream, LineSource(stream, JOINTS, 100.0) as source:
        try:
            while (sample := source.read(1.0)) is not None:
                found.append([sample.t, *sample.q, *sample.qd, *sample.current])
        except SourceClosed:
            pass
    return found


def _dataset(path: Path) -> Any:
    """The dataset whose shard, manifest or head ``path`` was put in place of."""
    from tauguard.datasets.reader import read

    folder = path.parent / "dataset"
    return [(signals(trace), dict(trace.attachments)) for trace in read(folder)]


# -- judges -----------------------------------------------------------------------------------


def _cells(path: Path) -> Array:
    rows = [line.split(",") for line in path.read_text("utf-8-sig").splitlines() if line.strip()]
    numbers = [[float(cell.strip().strip('"')) for cell in row] for row in rows]
    return np.array(numbers)


def _as_text(path: Path, found: Any, intact: Any) -> str:
    """The numbers of the text, read line by line."""
    told = np.column_stack([np.asarray(part) for part in found])
    return "" if np.array_equal(told, _cells(path)) else "other numbers than the text's"


def _as_lines(path: Path, found: Any, intact: Any) -> str:
    text = path.read_bytes()
    lines = text.split(b"\n")[:-1]
    told = [[float(cell) for cell in line.split(b",")] for line in lines]
    return "" if repr(told) == repr([list(map(float, row)) for row in found]) else "other numbers"


def _as_json(path: Path, found: Any, intact: Any) -> str:
    told = json.loads(path.read_text("utf-8-sig"))
    same = all(
        (sorted(value) if name == "repair" else list(value) if isinstance(value, tuple) else value)
        == (sorted(told[name]) if name == "repair" else told[name])
        for name, value in vars(found).items()
        if name in told
    )
    right = isinstance(found.degrees, bool) and set(told) <= set(vars(found))
    return "" if same and right else "other fields than the text's"


def _as_toml(path: Path, found: Any, intact: Any) -> str:
    told = tomllib.loads(path.read_text())
    names = [name for name in ("name", "seed", "rate", "episodes_per_shard") if name in told]
    splits = [(s["name"], s["episodes"]) for s in told["splits"]]
    same = all(getattr(found, name) == told[name] for name in names)
    return "" if same and splits == [(s.name, s.episodes) for s in found.splits] else "other values"


def _as_arm(path: Path, found: Any, intact: Any) -> str:
    told = tomllib.loads(path.read_text())
    for name, value in told.items():
        own = getattr(found, name, None)
        if isinstance(value, list) and not np.array_equal(np.asarray(own), np.asarray(value)):
            return f"another {name} than the text's"
    return ""


def _as_xml(path: Path, found: Any, intact: Any) -> str:
    """Joints and masses that the elements name."""
    root = ElementTree.fromstring(path.read_text("utf-8-sig"))
    if root.tag == "robot":
        moving = [j for j in root.iter("joint") if j.get("type") != "fixed"]
        below = [j.find("child").get("link") for j in moving]  # type: ignore[union-attr]
        masses = [
            float(mass.get("value", "nan"))
            for link in root.iter("link")
            if link.get("name") in below
            for mass in link.iter("mass")
        ]
    else:
        moving = [j for body in root.iter("body") for j in body.findall("joint")]
        carried = {
            id(b)
            for body in root.iter("body")
            if body.find("joint") is not None
            for b in body.iter("body")
        }
        geoms = [
            g for body in root.iter("body") if id(body) in carried for g in body.findall("geom")
        ]
        masses = [float(g.get("mass", "nan")) for g in geoms]
    joints, mass = found
    if joints != len(moving):
        return f"{joints} joints, the text has {len(moving)}"
    wrong = np.isfinite(masses).all() and abs(mass - sum(masses)) > 1e-9 * max(1.0, abs(mass))
    return f"a mass of {mass}, the text's is {sum(masses)}" if wrong or not mass >= 0 else ""


def _as_obj(path: Path, found: Any, intact: Any) -> str:
    rows = [line.split() for line in path.read_bytes().splitlines()]
    points = [[float(x) for x in row[1:4]] for row in rows if row[:1] == [b"v"]]
    faces = [[int(x.split(b"/")[0]) - 1 for x in row[1:]] for row in rows if row[:1] == [b"f"]]
    same = np.array_equal(found[0], np.array(points)) and np.array_equal(found[1], np.array(faces))
    return "" if same else "another mesh than the text's"


def _as_ply(path: Path, found: Any, intact: Any) -> str:
    head, _, body = path.read_bytes().partition(b"end_header\n")
    counts = [int(line.split()[2]) for line in head.splitlines() if line[:8] == b"element "]
    rows = [line.split() for line in io.BytesIO(body)]
    points = np.array([[float(x) for x in row] for row in rows[: counts[0]]])
    faces = np.array([[int(x) for x in row[1:]] for row in rows[counts[0] : sum(counts)]])
    same = np.array_equal(found[0], points) and np.array_equal(found[1], faces)
    return "" if same else "another mesh than the text's"


FORMATS: dict[str, Format] = {
    "csv": Format("csv", _csv, _as_text, "an own reading of the text"),
    "lines": Format("txt", _lines, _as_lines, "an own reading of the text"),
    "recording": Format("mcap", _recording, unchanged, "the intact file"),
    "joint states": Format("mcap", _log, unchanged, "the intact file"),
    "columns": Format("json", _columns, _as_json, "the JSON values"),
    "mjcf": Format("xml", _robot, _as_xml, "joints and masses of the XML"),
    "urdf": Format("urdf", _robot, _as_xml, "joints and masses of the XML"),
    "robot": Format("toml", _arm, _as_arm, "the TOML values"),
    "configuration": Format("toml", _configuration, _as_toml, "the TOML values"),
    "model": Format("skops", _model, unchanged, "the intact file"),
    "shard": Format("parquet", _dataset, unchanged, "the intact dataset"),
    "manifest": Format("jsonl", _dataset, unchanged, "the intact dataset"),
    "head": Format("json", _dataset, unchanged, "the intact dataset"),
    "dataset's arm": Format("xml", _dataset, unchanged, "the intact dataset"),
    "obj": Format("obj", _mesh, _as_obj, "an own reading of the text"),
    "ply": Format("ply", _mesh, _as_ply, "an own reading of the text"),
}
#: Where in the dataset's folder the damaged file belongs.
PLACES = {
    "shard": "data/train-000000.parquet",
    "manifest": "manifest/train-000000.jsonl",
    "head": "dataset.json",
    "dataset's arm": "arms/cura6.xml",
}


def originals(folder: Path, kinds: tuple[str, ...] = tuple(FORMATS)) -> dict[str, Path]:
    """A small intact file of every format; damaged ones are written beside it."""
    found = {kind: folder / kind / f"intact.{FORMATS[kind].ending}" for kind in kinds}
    for kind, path in found.items():
        path.parent.mkdir()
        WRITERS[kind](path)
    return found


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
    from tauguard.datasets import free_episodes
    from tauguard.detectors import ArmModel, CollisionAlarm, RobotNumbers, save_model
    from tauguard.detectors.methods.current_threshold import CurrentThreshold
    from tauguard.envs import simulate
    from tauguard.models import cura6, cura6_drive, pin_model

    trace = simulate(free_episodes(0, 1, 4.0, (30.0,), (0.0,), None)[0])
    arm = ArmModel(RobotNumbers.from_pin(pin_model(cura6.arm_xml())), np.array(cura6_drive().gain))
    save_model(CollisionAlarm(CurrentThreshold().fit([trace], arm), 3.0), path)


def _write_robot(path: Path) -> None:
    arm = path.with_name("arm.xml")
    arm.write_text(ARM)
    path.write_text('file = "arm.xml"\ntorque_limit = [100.0, 50.0]\nmax_speed = [2.0, 3.0]\n')


def _write_part(kind: str, path: Path) -> None:
    from tauguard.datasets.configuration import load
    from tauguard.datasets.generation import generate_dataset

    made = path.parent.parent / "made"  # one dataset serves all its files
    if not made.exists():
        text = path.parent.parent / "small.toml"
        text.write_text(SPLITS)
        generate_dataset(load(text), made, workers=1)
    shutil.copytree(made, path.parent / "dataset")
    shutil.copy(made / PLACES[kind], path)


def _write_mesh(path: Path) -> None:
    from tauguard.cloth.scenes import SCENES

    scene = SCENES["pleats"](60, 0)
    (x, _), *_ = scene.steps(1)
    points = [" ".join(repr(float(v)) for v in row) for row in x]
    if path.suffix == ".obj":
        lines = [f"v {p}" for p in points] + [
            f"f {a + 1} {b + 1} {c + 1}" for a, b, c in scene.faces
        ]
    else:
        properties = [f"property double {axis}" for axis in "xyz"]
        lines = ["ply", "format ascii 1.0", f"element vertex {len(x)}", *properties]
        lines += [f"element face {len(scene.faces)}", "property list uchar int vertex_indices"]
        lines += ["end_header", *points, *(f"3 {a} {b} {c}" for a, b, c in scene.faces)]
    path.write_text("\n".join(lines) + "\n")


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
    "obj": _write_mesh,
    "ply": _write_mesh,
}


def place(kind: str, folder: Path, data: bytes) -> Path:
    """Write a damaged file where its reader looks for it."""
    path = folder / f"damaged.{FORMATS[kind].ending}"
    target = folder / "dataset" / PLACES[kind] if kind in PLACES else path
    target.write_bytes(data)
    return path
