"""Damages files and reads them, in this process or in one of limited memory.

A file that crashes its reader, or that never ends, is counted and ends only that process.
"""

from __future__ import annotations

import multiprocessing
import os
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from slow.formats import FORMATS, originals, place

#: A small file may take this time to read [s], and this memory beyond an idle reader's [bytes].
MOST_SECONDS, MOST_MEMORY = 10.0, 1 << 30
#: Time limit for a worker to start and read the intact files [s].
STARTING = 300.0


@dataclass(frozen=True)
class Outcome:
    """The outcome of one damaged file."""

    said: str  #: "read", "refused", "wrong", "traceback", "crash" or "hang"
    message: str
    seconds: float

    @property
    def ok(self) -> bool:
        """A right answer or one line, in time."""
        return self.said in ("read", "refused")


#: Bytes that are written into a file to damage it.
BLOCKS = (
    *(b"9" * 400, b"[" * 5000, b"{" * 5000, b"<a>" * 5000, b'"', b"nan", b"-1e999", b"\x00"),
    *(b"\xff\xff\xff\xff\xff\xff\xff\x7f", b"null", b"../", b"1e160", b"-", b"1e100", b"true"),
)


def damage(data: bytes, rng: np.random.Generator) -> bytes:
    """The bytes with one small change, or with one to three large ones."""
    if rng.random() < 0.5:
        return _slightly(data, rng)
    for _ in range(int(rng.integers(1, 4))):
        at, end = sorted(int(x) for x in rng.integers(0, len(data) + 1, 2))
        noise = bytes(rng.integers(0, 256, 8).astype(np.uint8))
        block = (noise, *BLOCKS)[int(rng.integers(len(BLOCKS) + 1))]
        data = (
            data[:at],
            data[:at] + block + data[at:],
            data[:at] + block + data[at + len(block) :],
            data[:at] + data[end:],
            data[:end] + data[at:end] + data[end:],
        )[int(rng.integers(5))]
    return data


def _slightly(data: bytes, rng: np.random.Generator) -> bytes:
    """Flip a bit, drop a byte, change a digit, or drop or repeat a line."""
    at, kind = int(rng.integers(len(data))), int(rng.integers(5))
    if kind == 0:
        return data[:at] + bytes([data[at] ^ 1 << int(rng.integers(8))]) + data[at + 1 :]
    if kind == 1:
        return data[:at] + data[at + 1 :]
    if kind == 2:
        digits = [k for k in range(at, min(at + 4000, len(data))) if 48 <= data[k] <= 57]
        at = digits[0] if digits else at
        return data[:at] + bytes([48 + int(rng.integers(10))]) + data[at + 1 :]
    lines = data.splitlines(keepends=True)
    line = int(rng.integers(len(lines)))
    again = [lines[line]] * (2 if kind == 3 else 0)
    return b"".join([*lines[:line], *again, *lines[line + 1 :]])


class Reading:
    """Reads damaged files of the formats in this process."""

    def __init__(self, kinds: Sequence[str], folder: Path) -> None:
        """Write the intact files and read them."""
        self._files = originals(folder, tuple(kinds))
        self._data = {kind: path.read_bytes() for kind, path in self._files.items()}
        self._intact = {}
        for kind, path in self._files.items():
            self._intact[kind] = FORMATS[kind].read(path)
            wrong = FORMATS[kind].judge(path, self._intact[kind], self._intact[kind])
            if wrong:
                raise RuntimeError(f"the judge of {kind} rejects the intact file: {wrong}")

    def tried(self, kind: str, seed: Sequence[int]) -> Outcome:
        """Damage the intact file by this seed, read it and judge the answer."""
        data = damage(self._data[kind], np.random.default_rng(seed))
        path = place(kind, self._files[kind].parent, data)
        said, message = "read", ""
        start = time.monotonic()
        try:
            found = FORMATS[kind].read(path)
        except (ValueError, OSError) as error:
            said, message = "refused", str(error)
            if "Traceback" in message or len(message.splitlines()) > 1:
                said = "traceback"
        except Exception as error:
            said, message = "traceback", f"{type(error).__name__}: {str(error)[:200]}"
        seconds = time.monotonic() - start
        if said == "read" and data != self._data[kind]:
            message = self._judged(kind, path, found)
            said = "wrong" if message else "read"
        if seconds > MOST_SECONDS:
            said = "hang"
        return Outcome(said, message, seconds)

    def _judged(self, kind: str, path: Path, found: Any) -> str:
        try:
            return FORMATS[kind].judge(path, found, self._intact[kind])
        except Exception as error:
            return f"the judge cannot read it: {type(error).__name__}: {str(error)[:100]}"


def _work(pipe: Connection, kinds: Sequence[str], folder: str) -> None:
    """Receive seeds and send outcomes until the pipe closes."""
    import resource
    import warnings

    warnings.simplefilter("ignore")
    reading = Reading(kinds, Path(folder))
    if os.path.exists("/proc/self/statm"):
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        most = pages * resource.getpagesize() + MOST_MEMORY
        resource.setrlimit(resource.RLIMIT_AS, (most, resource.getrlimit(resource.RLIMIT_AS)[1]))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    pipe.send(None)
    while True:
        try:
            kind, seed = pipe.recv()
        except EOFError:
            return
        pipe.send(reading.tried(kind, seed))


class Worker:
    """A process that reads damaged files; it is replaced when it dies or hangs."""

    def __init__(self, kinds: Sequence[str]) -> None:
        """No process runs yet: the first file starts one."""
        self._kinds = tuple(kinds)
        self._process: Any = None

    def tried(self, kind: str, seed: Sequence[int]) -> Outcome:
        """Damage the intact file by this seed, read it and judge the answer."""
        if self._process is None:
            self._start()
        begin = time.monotonic()
        try:
            self._pipe.send((kind, tuple(seed)))
            if self._pipe.poll(MOST_SECONDS + 5):
                found: Outcome = self._pipe.recv()
                return found
            said = "hang"
        except (EOFError, OSError):
            said = "crash"
        self.close()
        return Outcome(said, "", time.monotonic() - begin)

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._folder = tempfile.TemporaryDirectory()
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(
            target=_work, args=(theirs, self._kinds, self._folder.name), daemon=True
        )
        self._process.start()
        theirs.close()
        if not self._pipe.poll(STARTING):
            raise RuntimeError("a reader of intact files does not end")
        self._pipe.recv()

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._pipe.close()
            self._folder.cleanup()
            self._process = None
