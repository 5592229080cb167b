"""Files that are there whole or not at all, whatever happens while they are written."""

from __future__ import annotations

import contextlib
import os
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

#: Ending of a file that is being written; its name begins with a dot.
PART = ".part"


@contextlib.contextmanager
def whole_file(path: Path) -> Iterator[BinaryIO]:
    """A stream whose bytes become ``path`` when the block ends without an error.

    They are written beside ``path`` under a name that begins with a dot and ends in ``.part``,
    forced to the disk, and renamed. After an error nothing is left of them and ``path`` is what it
    was; only a process that is killed leaves its part (see :func:`remove_parts`).

    Raises:
        OSError: the folder cannot be written, or the disk is full; the message names ``path``.
    """
    part = path.parent / f".{path.name}.{uuid.uuid4().hex[:8]}{PART}"
    try:
        with open(part, "xb") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(part, path)
        _sync_folder(path.parent)
    except OSError as error:
        _remove(part)
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error
    except BaseException:
        _remove(part)
        raise


def write_whole(path: Path, content: bytes | str) -> None:
    """Write ``content`` (text as UTF-8) to ``path``, whole or not at all."""
    with whole_file(path) as stream:
        stream.write(content.encode() if isinstance(content, str) else content)


def remove_parts(folder: Path) -> None:
    """Remove what killed writers left in ``folder`` and below; nobody may be writing there."""
    for part in folder.rglob(f".*{PART}"):
        _remove(part)


def _remove(part: Path) -> None:
    with contextlib.suppress(OSError):
        part.unlink()


def _sync_folder(folder: Path) -> None:
    """Force a rename to the disk, where the system can."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
