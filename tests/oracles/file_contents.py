"""The truth of what a reader returns: the intact file's content, or a second parser of the bytes.

A judge takes the path, the answer, and the answer of the intact file; it returns what is wrong, or
"" where the answer is right.
"""

from __future__ import annotations

import json
import tomllib
import xml.etree.ElementTree as ElementTree
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tauguard.arrays import Array


def unchanged(path: Path, found: Any, intact: Any) -> str:
    """The file has a checksum: it answers as the intact one does, or not at all."""
    return "" if repr(plain(found)) == repr(plain(intact)) else "answers otherwise than intact"


def plain(value: Any) -> Any:
    """Arrays and dataclasses as something that can be compared by its text."""
    if isinstance(value, np.ndarray):
        return (value.dtype.str, value.shape, value.tobytes())
    if is_dataclass(value) and not isinstance(value, type):
        return [(f.name, plain(getattr(value, f.name))) for f in fields(value)]
    if isinstance(value, dict):
        return sorted((str(k), plain(v)) for k, v in value.items())
    return [plain(v) for v in value] if isinstance(value, list | tuple) else value


def _cells(path: Path) -> Array:
    rows = [line.split(",") for line in path.read_text("utf-8-sig").splitlines() if line.strip()]
    numbers = [[float(cell.strip().strip('"')) for cell in row] for row in rows]
    return np.array(numbers)


def as_text(path: Path, found: Any, intact: Any) -> str:
    """The numbers of the text, read line by line."""
    wanted = np.column_stack([np.asarray(part) for part in found])
    return "" if np.array_equal(wanted, _cells(path)) else "other numbers than the text's"


def as_lines(path: Path, found: Any, intact: Any) -> str:
    """The numbers of the lines that end, read one by one; NaN where a line is no sample."""

    def numbers(line: bytes) -> list[float]:
        try:
            row = [float(cell) for cell in line.split(b",")]
        except ValueError:
            row = []
        return row if len(row) == len(intact[0]) else [float("nan")] * len(intact[0])

    wanted = [numbers(line) for line in path.read_bytes().split(b"\n")[:-1]]
    return "" if repr(wanted) == repr([list(map(float, row)) for row in found]) else "other numbers"


def as_json(path: Path, found: Any, intact: Any) -> str:
    """The values of the JSON."""
    wanted = json.loads(path.read_text("utf-8-sig"))
    same = all(
        (sorted(value) if name == "repair" else list(value) if isinstance(value, tuple) else value)
        == (sorted(wanted[name]) if name == "repair" else wanted[name])
        for name, value in vars(found).items()
        if name in wanted
    )
    right = isinstance(found.degrees, bool) and set(wanted) <= set(vars(found))
    return "" if same and right else "other fields than the text's"


def as_toml(path: Path, found: Any, intact: Any) -> str:
    """The values of the TOML."""
    wanted = tomllib.loads(path.read_text())
    names = [name for name in ("name", "seed", "rate", "episodes_per_shard") if name in wanted]
    splits = [(s["name"], s["episodes"]) for s in wanted["splits"]]
    same = all(getattr(found, name) == wanted[name] for name in names)
    return "" if same and splits == [(s.name, s.episodes) for s in found.splits] else "other values"


def as_arm(path: Path, found: Any, intact: Any) -> str:
    """The arrays of the TOML."""
    wanted = tomllib.loads(path.read_text())
    for name, value in wanted.items():
        own = getattr(found, name, None)
        if isinstance(value, list) and not np.array_equal(np.asarray(own), np.asarray(value)):
            return f"another {name} than the text's"
    return ""


def as_xml(path: Path, found: Any, intact: Any) -> str:
    """Joints and masses that the elements name."""
    root = ElementTree.fromstring(path.read_text("utf-8-sig"))
    if root.tag == "robot":
        moving = [j for j in root.iter("joint") if j.get("type") != "fixed"]
        below = [j.find("child").get("link") for j in moving]  # type: ignore[union-attr]
        masses = [
            float(mass.get("value") or "nan")
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
        masses = [float(g.get("mass") or "nan") for g in geoms]
    joints, mass = found
    if joints != len(moving):
        return f"{joints} joints, the text has {len(moving)}"
    wrong = np.isfinite(masses).all() and abs(mass - sum(masses)) > 1e-9 * max(1.0, abs(mass))
    return f"a mass of {mass}, the text's is {sum(masses)}" if wrong or not mass >= 0 else ""


def as_rtde(path: Path, found: Any, intact: Any) -> str:
    """The samples of the data packets after the handshake, up to what is no packet."""
    data, at, asked, wanted = path.read_bytes(), 0, list(b"VvOS"), []
    while at + 3 <= len(data):
        size, kind = int.from_bytes(data[at : at + 2], "big"), data[at + 2]
        body = data[at + 3 : at + size]
        if size < 3 or at + size > len(data):
            break
        at += size
        if asked:
            asked = asked[1:] if kind == asked[0] else asked
        elif kind == ord("U"):
            if len(body) != 1 + 8 * 19 or body[0] != recipe(data):
                break
            wanted.append(np.frombuffer(body, ">f8", offset=1).tolist())
    return "" if repr(wanted) == repr([list(map(float, row)) for row in found]) else "other samples"


def recipe(data: bytes) -> int:
    """The number of the recipe in the first answer that sets up outputs, after V and v."""
    at, asked = 0, list(b"VvO")
    while True:
        kind = data[at + 2]
        if kind == asked[0]:
            asked = asked[1:]
        if not asked:
            return data[at + 3]
        at += int.from_bytes(data[at : at + 2], "big")
