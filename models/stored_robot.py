"""A robot file with the surface of its links, as a model file stores it."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tauguard.arrays import in_a_line
from tauguard.findings import FileError
from tauguard.models.link_surface import LinkSurface, arm_surface, link_surface
from tauguard.models.robot import bodies_file
from tauguard.untrusted_input import read_text


@dataclass(frozen=True, eq=False)
class StoredRobot:
    """The text of a robot file, and points on its links, which need no meshes any more."""

    __repr__ = in_a_line

    name: str  #: of the file
    text: str  #: URDF or MJCF
    surface: LinkSurface | None = None  #: None: unknown, see ``doubt``
    sticks: tuple[str, ...] = ()  #: links without a shape, for which thin capsules stand
    doubt: str = ""  #: why there is no surface

    def __post_init__(self) -> None:
        """Check the name: ``FileError`` if it is not that of a file alone."""
        if Path(self.name).name != self.name or not self.name:
            raise FileError(f"name {self.name!r:.100}: expected a file's name without a folder")

    @classmethod
    def of(cls, robot: str | Path, joints: tuple[str, ...]) -> StoredRobot:
        """The robot in a file.

        Args:
            robot: URDF, MJCF, a TOML description, or a name that `tauguard robot` lists.
            joints: names of the arm's joints; every other joint is welded at zero.

        Raises:
            FileError: no text file, or a description without a robot.
            OSError: cannot be read.
        """
        path = bodies_file(Path(robot))
        text = read_text(path)
        try:
            surface, sticks = arm_surface(path, joints)
        except FileError as error:
            return cls(path.name, text, doubt=str(error))
        return cls(path.name, text, surface, sticks)

    @classmethod
    def of_text(cls, name: str, text: str) -> StoredRobot:
        """The robot in a recording's attachment, MJCF with all shapes in it."""
        try:
            return cls(name, text, link_surface(text))
        except FileError as error:
            return cls(name, text, doubt=str(error))


@contextlib.contextmanager
def robot_file(path: Path | None, stored: StoredRobot | None) -> Iterator[Path | None]:
    """The robot file while the context lasts: ``path``, else the stored text in a temporary folder.

    None if there is neither.
    """
    if path is not None or stored is None:
        yield path
        return
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / stored.name
        file.write_text(stored.text, encoding="utf-8")
        yield file
