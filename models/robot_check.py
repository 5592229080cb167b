"""Check untrusted robot files: the files they name, and a first compilation in a separate process.

MuJoCo's compiler can crash on XML that looks valid, so a file is compiled in a process of limited
memory and time first.
"""

import os
import xml.etree.ElementTree as ElementTree
from functools import lru_cache
from itertools import product
from pathlib import Path

from tauguard.models.robot_trial import Trial
from tauguard.untrusted_input import read_text, reading

#: Largest number of files that include one another.
MOST_INCLUDES = 100

#: Attributes that name a file: `file`, and one for each side of a cube's texture.
FILES = ("file", *(f"file{side}" for side in ("right", "left", "up", "down", "front", "back")))

#: The process that compiles files first.
TRIAL = Trial()


def checked_robot(path: Path) -> Path:
    """Check that ``path`` names only files of its folder and does not crash MuJoCo; returns it.

    A file that MuJoCo merely refuses passes, because its later compilation reports the reason.

    Raises:
        ValueError: a file outside the robot's folder is named, or MuJoCo crashes or needs more than
            1 GiB, 3 s of processor time or 10 s.
        OSError: cannot be read.
    """
    stamp = os.stat(path)
    _check(str(path.resolve()), stamp.st_mtime_ns, stamp.st_size)
    return path


def checked_text(text: str) -> str:
    """Check that the ``text`` of a robot does not crash MuJoCo; returns it.

    Raises:
        ValueError: as for :func:`checked_robot`.
    """
    _check_text(text)
    return text


@lru_cache(maxsize=64)
def _check_text(text: str) -> None:
    wrong = TRIAL.of(text=text)
    if wrong:
        raise ValueError(wrong)


@lru_cache(maxsize=256)
def _check(path: str, mtime: int, size: int) -> None:
    _check_names(Path(path))
    wrong = TRIAL.of(path=path)
    if wrong:
        raise ValueError(f"{path}: {wrong}")


def _check_names(path: Path) -> None:
    """Check that every file and folder that the robot names lies in the folder of its file."""
    folder, waiting, seen = path.parent.resolve(), [path], set[Path]()
    while waiting:
        one = waiting.pop()
        if one in seen:
            continue
        seen.add(one)
        if len(seen) > MOST_INCLUDES:
            raise ValueError(f"{path}: more than {MOST_INCLUDES} files include one another")
        with reading(one, "expected the XML of a robot"):
            root = ElementTree.fromstring(read_text(one))
        dirs = [folder]
        for compiler in root.iter("compiler"):
            for key in ("meshdir", "texturedir", "assetdir"):
                if key in compiler.attrib:
                    dirs.append(_inside(path, folder, folder, compiler.attrib[key]))
        for element in root.iter():
            names = [element.attrib[key] for key in FILES if key in element.attrib]
            for name, where in product(names, dirs):
                target = _inside(path, folder, where, name)
                if element.tag == "include" and target.is_file():
                    waiting.append(target)


def _inside(robot: Path, folder: Path, where: Path, name: str) -> Path:
    target = (where / name.replace("\\", "/")).resolve()  # both separate folders in MuJoCo
    if not target.is_relative_to(folder):
        raise ValueError(f"{robot}: names {name!r}, a file outside its folder {folder}")
    return target
