"""Source and identity of a dataset's arms that come from files or other packages."""

from __future__ import annotations

import functools
import hashlib
import json
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from tauguard.findings import FileError
from tauguard.models import Robot, Scene, SceneSpec, compose, cura6

#: Form of an arm's name in a dataset, where it is part of file names.
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,39}")


@dataclass(frozen=True)
class RobotSource:
    """An arm by name or file, and the hash of its model when the dataset was described."""

    name: str  #: name in the dataset: the given name, or the file's without extension
    source: str
    """A name that :func:`tauguard.models.load_arm` accepts, or the absolute path of a file. In
    ``dataset.json`` it is the file's name without folder."""
    joints: tuple[str, ...]
    sha256: str  #: hash of everything that the arm's simulation depends on

    def anywhere(self) -> RobotSource:
        """A copy with the file's name instead of its path on this machine."""
        return replace(self, source=Path(self.source).name)


def find_robot(asked: str, folder: Path) -> RobotSource:
    """The arm ``asked`` (name or file) of a configuration in ``folder``.

    Raises:
        FileError: no such arm, one that cannot be used, or a file name that is not allowed.
    """
    file = next((p.resolve() for p in (folder / asked, Path(asked)) if p.is_file()), None)
    source, name = (str(file), file.stem) if file else (asked, asked)
    try:
        scene = _scene(source)
    except FileNotFoundError as error:
        raise FileError(str(error)) from None
    if not _NAME.fullmatch(name):
        raise FileError(
            f"{asked}: expected a file name of letters, digits, -, _ and dots, up to 40"
        )
    if file and name in cura6.NAMES:
        raise FileError(f"{asked}: expected another file name, {name} is an arm of the package")
    return RobotSource(name, source, scene.joint_names, _digest(scene))


def nominal_texts(name: str, robots: Sequence[RobotSource]) -> dict[str, str]:
    """Names and texts that describe the nominal arm; see ``Scene.nominal_texts``."""
    for robot in robots:
        if robot.name == name:
            return _scene(robot.source).nominal_texts
    return {"arm.xml": cura6.arm_xml(name)}


def check_unchanged(name: str, robots: Sequence[RobotSource]) -> None:
    """Check that an arm's file has not changed since the dataset was described.

    Raises:
        FileError: the file has changed or does not exist.
    """
    for robot in robots:
        if robot.name != name:
            continue
        try:
            same = _digest(_scene(robot.source)) == robot.sha256
        except FileNotFoundError:
            raise FileError(
                f"arm {name}: its file {robot.source} is not here; give the file that the dataset "
                "was begun with by `robot=` (`tauguard inspect`)"
            ) from None
        if not same:
            raise FileError(
                f"arm {name}: {robot.source} is not what the dataset was begun with; restore the "
                "file, or name another folder"
            )


def _scene(source: str) -> Scene:
    named = [Path(source)]
    if source.lower().endswith(".toml") and named[0].is_file():
        named.append(Path(Robot.from_toml(source).file))
    return _composed(source, tuple(file.stat().st_mtime_ns for file in named if file.is_file()))


@functools.lru_cache(maxsize=16)
def _composed(source: str, changed: tuple[int, ...]) -> Scene:
    """The nominal scene, cached: with detailed meshes its text takes seconds to write."""
    return compose(SceneSpec(arm=source), visuals=False)


def _digest(scene: Scene) -> str:
    """SHA-256 of the nominal arm with its shapes, and of the facts that are not in its file."""
    facts = scene.facts
    rest = {key: value for key, value in asdict(facts).items() if key not in ("name", "sources")}
    text = json.dumps(rest, sort_keys=True, default=_plain)
    return hashlib.sha256(f"{scene.arm_xml}\n{text}".encode()).hexdigest()


def _plain(value: object) -> object:
    assert isinstance(value, np.ndarray)
    return value.tolist()
