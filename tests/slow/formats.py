"""Every file format that tauguard reads: its intact file, its reader, and the judge of answers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from oracles import file_contents as judges
from slow import readers
from slow.originals import PLACES, WRITERS


@dataclass(frozen=True)
class Format:
    """One kind of file."""

    ending: str
    read: Callable[[Path], Any]
    judge: Callable[[Path, Any, Any], str]  #: file, its answer, the intact file's; "" if right
    judged_by: str


FORMATS: dict[str, Format] = {
    "csv": Format("csv", readers.csv, judges.as_text, "a second parser of the text"),
    "lines": Format("txt", readers.lines, judges.as_lines, "a second parser of the text"),
    "recording": Format("mcap", readers.recording, judges.unchanged, "the intact file"),
    "joint states": Format("mcap", readers.log, judges.unchanged, "the intact file"),
    "columns": Format("json", readers.columns, judges.as_json, "the JSON values"),
    "mjcf": Format("xml", readers.robot, judges.as_xml, "joints and masses of the XML"),
    "urdf": Format("urdf", readers.robot, judges.as_xml, "joints and masses of the XML"),
    "robot": Format("toml", readers.arm, judges.as_arm, "the TOML values"),
    "configuration": Format("toml", readers.configuration, judges.as_toml, "the TOML values"),
    "model": Format("tauguard", readers.model, judges.unchanged, "the intact file"),
    "shard": Format("parquet", readers.dataset, judges.unchanged, "the intact dataset"),
    "manifest": Format("jsonl", readers.dataset, judges.unchanged, "the intact dataset"),
    "head": Format("json", readers.dataset, judges.unchanged, "the intact dataset"),
    "dataset's arm": Format("xml", readers.dataset, judges.unchanged, "the intact dataset"),
    "rtde": Format("rtde", readers.rtde, judges.as_rtde, "a second parser of the bytes"),
}


def originals(folder: Path, kinds: tuple[str, ...] = tuple(FORMATS)) -> dict[str, Path]:
    """A small intact file of every format; damaged ones are written beside it."""
    found = {kind: folder / kind / f"intact.{FORMATS[kind].ending}" for kind in kinds}
    for kind, path in found.items():
        path.parent.mkdir()
        WRITERS[kind](path)
    return found


def place(kind: str, folder: Path, data: bytes) -> Path:
    """Write a damaged file where its reader looks for it."""
    path = folder / f"damaged.{FORMATS[kind].ending}"
    target = folder / "dataset" / PLACES[kind] if kind in PLACES else path
    target.write_bytes(data)
    return path
