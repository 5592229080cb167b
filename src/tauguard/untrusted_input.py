"""Read untrusted files: every error in a file becomes a ``FileError`` of one line."""

import contextlib
import dataclasses
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tauguard.findings import FileError, Finding, TauguardError

#: Largest size of a text file [bytes]: settings, column maps, robot descriptions.
MOST_TEXT = 1 << 26


@contextlib.contextmanager
def reading(
    path: str | Path, expected: str = "", kind: type[FileError] = FileError
) -> Iterator[None]:
    """Turn every error that the content of ``path`` causes in this block into a ``FileError``.

    The message is one line and begins with the path; ``expected`` describes a valid file, ``kind``
    is the class of the error.

    Raises:
        FileError: the content cannot be read (the cause is chained), or ``path`` is a device such
            as ``/dev/zero``, which may be endless. A ``TauguardError`` of the block keeps the codes
            of its findings, and a subclass of ``FileError`` its class.
        OSError: as raised in the block.
    """
    check_no_device(path)
    try:
        yield
    except OSError:
        raise
    except TauguardError as error:
        if str(error).startswith(str(path)):
            raise
        same = type(error) if isinstance(error, kind) else kind
        raise same(*_in_file(error, path, expected)) from error
    except ValueError as error:
        said = str(error)
        if said.startswith(str(path)):
            raise
        raise kind(_line(path, said, expected)) from error
    except (RecursionError, MemoryError) as error:
        said = "nested too deep" if isinstance(error, RecursionError) else "too large"
        raise kind(_line(path, said, expected)) from error
    except Exception as error:
        said = f"damaged ({type(error).__name__}: {str(error)[:200]})"
        raise kind(_line(path, said, expected)) from error


def check_no_device(path: str | Path) -> None:
    """Raise ``FileError`` for a device such as ``/dev/zero``, which may be endless."""
    if Path(path).is_char_device():
        raise FileError(f"{path}: a device; expected a file")


def _in_file(error: TauguardError, path: str | Path, expected: str) -> Iterator[Finding]:
    """The findings of an error; the text of those that caused it begins with the path."""
    for finding in error.findings:
        stops = finding.severity == "error"
        text = _line(path, finding.text, expected) if stops else finding.text
        yield dataclasses.replace(finding, text=text)


def _line(path: str | Path, said: str, expected: str) -> str:
    return f"{path}: {' '.join(said.split())[:1000]}" + (f"; {expected}" if expected else "")


def read_text(path: str | Path) -> str:
    """A text file of at most :data:`MOST_TEXT` bytes, UTF-8.

    Raises:
        FileError: the file is longer, or not text.
        OSError: missing or unreadable.
    """
    with open(path, "rb") as stream:
        data = stream.read(MOST_TEXT + 1)
    if len(data) > MOST_TEXT:
        raise FileError(f"{path}: more than {MOST_TEXT >> 20} MiB; expected a smaller text file")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileError(
            f"{path}: not a text file ({error.reason} at byte {error.start})"
        ) from error


def read_json(path: str | Path) -> Any:
    """The content of a JSON file; depth and length are bounded.

    Raises:
        FileError: the file is not JSON, or nested too deep.
        OSError: the file is missing or unreadable.
    """
    with reading(path, "expected JSON"):
        return json.loads(read_text(path))
