"""Atomic writing: after any interruption a file is either complete or unchanged."""

import contextlib
import os
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

#: Extension of a file during writing; its name begins with a dot.
PART = ".part"


@contextlib.contextmanager
def atomic_file(path: Path) -> Iterator[BinaryIO]:
    """A stream whose bytes become ``path`` when the block ends without an error.

    The bytes go to a file beside ``path`` whose name begins with a dot and ends in ``.part``. That
    file is flushed to the disk and renamed. After an error it is removed and ``path`` is unchanged.
    Only a process that is killed leaves its ``.part`` file (see :func:`remove_parts`).

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


def write_atomic(path: Path, content: bytes | str) -> None:
    """Write ``content`` (text as UTF-8) to ``path``, completely or not at all."""
    with atomic_file(path) as stream:
        stream.write(content.encode() if isinstance(content, str) else content)


def write_changed(path: Path, text: str) -> None:
    """Write ``text`` to ``path``, unless the file has this content already."""
    if not path.is_file() or path.read_bytes() != text.encode():
        write_atomic(path, text)


def remove_parts(folder: Path) -> None:
    """Remove the files that killed writers left in ``folder``; no writer may be running there."""
    for part in folder.rglob(f".*{PART}"):
        _remove(part)


def _remove(part: Path) -> None:
    with contextlib.suppress(OSError):
        part.unlink()


def _sync_folder(folder: Path) -> None:
    """Flush a rename to the disk, if the system supports it."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
