"""Download of the originals, each checked by its hash, and their conversion.

The data folder gets the converted logs, under ``originals/SET`` the files as published, and under
``licences`` a notice of each set's licence and citation. A file is there complete or not at all, so
an interrupted run goes on with the next file.
"""

from __future__ import annotations

import contextlib
import errno
import io
import os
import struct
import time
import urllib.parse
from collections.abc import Callable, Iterator
from pathlib import Path

from tauguard.atomic_write import remove_parts, write_atomic, write_changed
from tauguard.benchmark.conversion import CONVERSIONS
from tauguard.benchmark.manifest import (
    Converted,
    DataSet,
    Original,
    chosen,
    data_folder,
    hashed,
    is_complete,
)
from tauguard.extras import extra
from tauguard.findings import ArgumentError, FileError

#: Attempts to download a file, the pause before the second one [s], which doubles, and the time
#: without an answer after which an attempt ends [s].
ATTEMPTS, PAUSE, TIMEOUT = 4, 1.0, 30.0

AFTERWARDS = (
    "run the same command again (complete files are kept), or name a mirror of the originals with "
    '`from="URL"`'
)

Report = Callable[[str], None]


def fetch(
    name: str, base: str | None = None, folder: Path | None = None, report: Report = print
) -> Path:
    """Download and convert a set; what is there and complete is not downloaded again.

    Args:
        name: a set, or ``"all"``.
        base: address of a mirror, which has the originals under SET/PATH; default: the publishers'.
        folder: default: :func:`~tauguard.benchmark.manifest.data_folder`.
        report: called with lines for the user: licence, citation, progress.

    Returns:
        The folder.

    Raises:
        ArgumentError: no such set, or the extra ``data`` is not installed.
        FileError: a download failed, or has other bytes than the manifest says; the message says
            what to do.
        OSError: the folder cannot be written.
    """
    wanted, folder = chosen(name), folder or data_folder()
    if base is not None and urllib.parse.urlsplit(base).scheme not in ("http", "https"):
        raise ArgumentError(f'`from="{base}"`: expected an address such as http://127.0.0.1:8000')
    folder.mkdir(parents=True, exist_ok=True)
    with _alone(folder):
        remove_parts(folder)
        failed = []
        for dataset in wanted:
            try:
                _fetch_set(dataset, base, folder, report)
            except _SetError as error:
                failed.append(str(error))
    if failed:
        raise FileError("; ".join(failed) + f"; {AFTERWARDS}")
    return folder


class _SetError(Exception):
    """A set is not complete; the next one may be."""


def _fetch_set(dataset: DataSet, base: str | None, folder: Path, report: Report) -> None:
    report(dataset.notice().rstrip())
    with _room_on_disk(folder, dataset):
        (folder / "licences").mkdir(exist_ok=True)
        write_changed(folder / "licences" / f"{dataset.name}.txt", dataset.notice())
        store, loaded, made = folder / "originals" / dataset.name, 0, 0
        hashed_logs = [log for log in dataset.converted if log.sha256]
        if len(hashed_logs) == len(dataset.converted) and all(
            is_complete(folder, log) for log in hashed_logs
        ):
            report(f"{dataset.name}: complete, {len(hashed_logs)} files in {folder}")
            return
        for original in dataset.originals:
            if not is_complete(store, original):
                _download(_address(dataset, original, base), store, original)
                loaded += 1
        for log in dataset.converted:
            made += _convert(dataset, log, store, folder)
    report(
        f"{dataset.name}: {loaded} of {len(dataset.originals)} files downloaded, {made} of "
        f"{len(dataset.converted)} converted, in {folder}"
    )


def _address(dataset: DataSet, original: Original, base: str | None) -> str:
    path = urllib.parse.quote(original.path)
    return f"{dataset.base}{path}" if base is None else f"{base.rstrip('/')}/{dataset.name}/{path}"


def _download(url: str, store: Path, original: Original) -> None:
    """Store one original if its hash is right; an interrupted transfer is tried again."""
    for attempt in range(ATTEMPTS):
        if attempt:
            time.sleep(PAUSE * 2 ** (attempt - 1))
        content, trouble, final = _transfer(url)
        if not trouble and (actual := hashed(content, original.hash)) != original.hash:
            trouble = f"{len(content)} bytes with the hash {actual}, expected {original.hash}"
            trouble += f" of {original.bytes} bytes" if original.bytes else ""
        if not trouble:
            target = store / original.path
            target.parent.mkdir(parents=True, exist_ok=True)
            write_atomic(target, content)
            return
        if final:
            break
    raise _SetError(f"{url}: {trouble}")


def _transfer(url: str) -> tuple[bytes, str, bool]:
    """The content at an address, what went wrong or an empty text, and whether that is final."""
    try:
        import pooch
        import requests
    except ImportError:
        raise ArgumentError(f"downloads need {extra('data')}") from None
    content = io.BytesIO()
    try:
        pooch.HTTPDownloader(timeout=TIMEOUT)(url, content, None)
    except requests.HTTPError as error:
        status = error.response.status_code
        return b"", f"the server answers {status} {error.response.reason}", 400 <= status < 500
    except requests.Timeout:
        return b"", f"no answer in {TIMEOUT:g} s", False
    except requests.ConnectionError:
        return b"", "no connection to the server, or it broke", False
    except requests.RequestException as error:
        return b"", " ".join(str(error).split()), False
    return content.getvalue(), "", False


def _convert(dataset: DataSet, log: Converted, store: Path, folder: Path) -> bool:
    """Make one log of its originals, unless it is there; whether it was made."""
    if log.sha256 and is_complete(folder, log):
        return False
    contents = [(store / path).read_bytes() for path in log.originals]
    try:
        content = CONVERSIONS[dataset.conversion](contents)
    except (ValueError, IndexError, KeyError, struct.error) as error:
        raise FileError(
            f"{log.originals[0]} of {dataset.name} cannot be converted: {error}"
        ) from None
    if log.sha256 and hashed(content, "") != log.sha256:
        raise FileError(
            f"{log.path}: the conversion gives the hash {hashed(content, '')}, expected "
            f"{log.sha256}; the original has the right hash, so this is a defect of tauguard"
        )
    (folder / log.path).parent.mkdir(parents=True, exist_ok=True)
    write_atomic(folder / log.path, content)
    return True


@contextlib.contextmanager
def _room_on_disk(folder: Path, dataset: DataSet) -> Iterator[None]:
    """Say what to do if the disk is full."""
    try:
        yield
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
            raise
        raise FileError(
            f"{folder}: no room on the disk for {dataset.name} ({dataset.size / 1e6:.0f} MB of "
            "originals, and as much again for the logs); make room, or name another folder in "
            "TAUGUARD_DATA, and run the same command again: complete files are kept"
        ) from error


@contextlib.contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """One process at a time; the lock ends with the process, however that ends."""
    try:
        import fcntl
    except ImportError:  # this system has no flock
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise FileError(
                f"{folder}: another process is fetching into it; wait until that one ends"
            ) from None
        yield
    finally:
        os.close(handle)
