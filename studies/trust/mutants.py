"""Damaged files of every format that tauguard reads: each ends in an answer or in one line.

A worker process of limited memory reads them, so that one that crashes it or never ends is counted
and not the end of the study.
"""

from __future__ import annotations

import multiprocessing
import os
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.trust.formats import FORMATS, originals, place
from tauguard.report import Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: No small file may take longer to read [s], nor more memory beyond that of an idle reader [bytes].
MOST_SECONDS, MOST_MEMORY = 10.0, 1 << 30
#: Time in which a worker starts and reads the intact files [s].
STARTING = 300.0
#: Files of a full and of a quick run.
COUNT, QUICK = 10_000, 300

NOTES = {
    "mutants": "files: half with one bit, byte, digit or line changed, half with one to three "
    "larger damages. read, refused: an answer, or one line. wrong: an answer that the judge calls "
    "wrong. traceback: anything but one line. crash: the process ended. hang: over 10 s. Memory is "
    "limited to 1 GiB beyond an idle reader's.",
}


@dataclass(frozen=True)
class Outcome:
    """What became of one damaged file."""

    said: str  #: "read", "refused", "wrong", "traceback", "crash" or "hang"
    message: str
    seconds: float

    @property
    def ok(self) -> bool:
        """A right answer or one line, in time."""
        return self.said in ("read", "refused")


#: What damage writes into a file.
BLOCKS = (
    *(b"9" * 400, b"[" * 5000, b"{" * 5000, b"<a>" * 5000, b'"', b"nan", b"-1e999", b"\x00"),
    *(b"\xff\xff\xff\xff\xff\xff\xff\x7f", b"null", b"../", b"1e160", b"-", b"1e100", b"true"),
)


def mutant(data: bytes, rng: np.random.Generator) -> bytes:
    """The bytes with one small damage, or with one to three large ones."""
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
    """One bit, one byte, one digit or one line is another, gone or there twice."""
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
    """Reads mutants of the formats in this process."""

    def __init__(self, kinds: Sequence[str], folder: Path) -> None:
        """Write the intact files and read them."""
        self._files = originals(folder, tuple(kinds))
        self._data = {kind: path.read_bytes() for kind, path in self._files.items()}
        self._intact = {}
        for kind, path in self._files.items():
            self._intact[kind] = FORMATS[kind].read(path)
            wrong = FORMATS[kind].judge(path, self._intact[kind], self._intact[kind])
            if wrong:
                raise RuntimeError(f"the judge of {kind} errs on the intact file: {wrong}")

    def tried(self, kind: str, seed: Sequence[int]) -> Outcome:
        """What becomes of the mutant of this seed."""
        data = mutant(self._data[kind], np.random.default_rng(seed))
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
    """Answer seeds with outcomes until the pipe ends."""
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
    """A process that reads mutants; another takes its place when it dies or hangs."""

    def __init__(self, kinds: Sequence[str]) -> None:
        """Nothing runs yet."""
        self._kinds = tuple(kinds)
        self._process: Any = None

    def tried(self, kind: str, seed: Sequence[int]) -> Outcome:
        """What becomes of the mutant of this seed."""
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


def outcomes(kinds: Sequence[str], count: int, seed: int) -> Iterator[tuple[str, Outcome]]:
    """Kind and outcome of ``count`` mutants, the kinds in turn."""
    worker = Worker(kinds)
    try:
        for number in range(count):
            kind = kinds[number % len(kinds)]
            yield kind, worker.tried(kind, (seed, number))
    finally:
        worker.close()


def run(quick: bool, seed: int) -> list[Row]:
    """A row a format, and one of all together."""
    kinds = tuple(FORMATS)
    found: dict[str, list[Outcome]] = {kind: [] for kind in kinds}
    for kind, outcome in outcomes(kinds, QUICK if quick else COUNT, seed):
        found[kind].append(outcome)
        if not outcome.ok:
            print(f"{kind} {len(found[kind])}: {outcome.said}: {outcome.message}", flush=True)
    rows = [_row(kind, FORMATS[kind].judged_by, found[kind]) for kind in kinds]
    return [*rows, _row("all", "", [one for many in found.values() for one in many])]


def _row(kind: str, judged_by: str, found: Sequence[Outcome]) -> Row:
    counts = Counter(outcome.said for outcome in found)
    return {
        "study": "mutants",
        "format": kind,
        "files": len(found),
        **{said: counts[said] for said in ("read", "refused", "wrong", "traceback")},
        **{said: counts[said] for said in ("crash", "hang")},
        "slowest [s]": max(outcome.seconds for outcome in found),
        "judged by": judged_by,
    }


def draw(rows: list[Row], figure: Figure) -> None:
    """What became of the files, a bar a format."""
    axes = figure.subplots()
    shown = [row for row in rows if row["format"] != "all"]
    left = np.zeros(len(shown))
    for said in ("refused", "read", "wrong", "traceback", "crash", "hang"):
        counts = np.array([row[said] / row["files"] for row in shown], dtype=float)
        axes.barh([str(row["format"]) for row in shown], counts, left=left, label=said)
        left += counts
    axes.set_xlabel("share of the damaged files")
    axes.legend(ncols=6, loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False)
