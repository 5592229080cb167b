"""Arms by name: their model files, and numbers that no model file states, with their sources.

Numbers that a row leaves out are derived, see :mod:`tauguard.models.derive`.
"""

import importlib.util
import sys
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from tauguard.extras import extra
from tauguard.findings import FileError
from tauguard.models.robot import Robot

#: Arms of this package, with published numbers and simple shapes.
PUBLISHED = Path(__file__).parent / "published"


@dataclass(frozen=True)
class KnownRobot:
    """A row: a file of this package or ``example-robot-data``, or a ``mujoco-menagerie`` name."""

    robot: Robot  #: description, whose ``file`` is the arm's name
    own: str | None  #: file in :data:`PUBLISHED`
    urdf: str | None  #: path below ``robots`` of example-robot-data
    menagerie: str | None  #: name in mujoco-menagerie
    sources: Mapping[str, str]  #: source of each field that the row states


def _known(name: str, row: dict[str, Any]) -> KnownRobot:
    own, urdf, menagerie = (row.pop(key, None) for key in ("own", "urdf", "menagerie"))
    sources = MappingProxyType(row.pop("sources", {}))
    robot = Robot.from_mapping({"file": name, **row})
    return KnownRobot(robot, own, urdf, menagerie, sources)


_TEXT = Path(__file__).with_suffix(".toml").read_text("utf-8")
#: The table; ``cura6`` is described in :mod:`tauguard.models.cura6` instead.
ROBOTS: Mapping[str, KnownRobot] = MappingProxyType(
    {name: _known(name, row) for name, row in tomllib.loads(_TEXT).items()}
)


def known_names() -> tuple[str, ...]:
    """Names in the table, then those of mujoco-menagerie's arms if it is installed."""
    names = list(ROBOTS)
    if importlib.util.find_spec("mujoco_menagerie") is not None:
        import mujoco_menagerie

        names += [robot.name for robot in mujoco_menagerie.robots("arm")]
    return tuple(names)


def find_file(name: str) -> Path:
    """The model file of a named arm, from this package, example-robot-data or menagerie.

    Nothing is downloaded here: ``tauguard robot NAME --download`` does it.

    Raises:
        FileNotFoundError: no installed package has the file; the message says what to install.
    """
    row = ROBOTS.get(name)
    if row is not None and row.own is not None:
        return PUBLISHED / row.own
    urdf, menagerie = (row.urdf, row.menagerie) if row else (None, name)
    if urdf is not None:
        for root in robot_data_folders():
            if (root / "robots" / urdf).is_file():
                return root / "robots" / urdf
    if menagerie is not None:
        path = menagerie_file(menagerie)
        if path is not None:
            return path
    installs = []
    if urdf is not None:
        installs.append(f"install example-robot-data: {extra('arms')}")
    if menagerie is not None:
        installs.append(
            f"install mujoco-menagerie: {extra('arms')} and run "
            f"`tauguard robot {name}` with `download=True` once"
        )
    raise FileNotFoundError(
        f"arm {name!r}: its model is in no installed package; "
        f"{', or '.join(installs)}, or give a file"
    )


def robot_data_folders() -> list[Path]:
    """The folder of example-robot-data's models, which ``package://example-robot-data`` means."""
    inside = Path("cmeel.prefix", "share", "example-robot-data")
    found = [Path(folder) / inside for folder in sys.path if folder]
    return [folder for folder in found if folder.is_dir()]


def menagerie_file(name: str, download: bool = False) -> Path | None:
    """The MJCF file of a menagerie model, None if it was not downloaded.

    Args:
        name: name of the model in mujoco-menagerie.
        download: download the model if it is not there yet.

    Raises:
        ModuleNotFoundError: ``download`` without mujoco-menagerie.
        FileError: no such model, or it cannot be fetched.
    """
    if not download and importlib.util.find_spec("mujoco_menagerie") is None:
        return None
    import mujoco_menagerie

    try:
        cache, robot = mujoco_menagerie.Cache(), mujoco_menagerie.get(name)
        if not (download or cache.root is not None or cache.is_cached(robot)):
            return None
        return Path(robot.xml(robot.default_model, cache))
    except mujoco_menagerie.MenagerieError as error:
        raise FileError(f"mujoco-menagerie: {error}") from None
