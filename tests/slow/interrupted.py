"""Runs that end early: killed, interrupted, without a worker, or on a full disk.

Every trial starts a command that writes recordings, ends it at a random moment, checks the folder,
and runs the command again to the end.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from slow.recordings import FILES, command

#: A command that ends later than the first time is late, later than the second it hangs [s].
AT_ONCE, HANGS = 5.0, 30.0
#: Ways to end a run, each with a number of workers, and the trials of a full run.
TRIALS = {
    ("kill -9", 1): 100,
    ("kill -9", 2): 100,
    ("full disk", 1): 100,
    ("full disk", 2): 100,
    ("Ctrl-C", 1): 50,
    ("Ctrl-C", 2): 50,
    ("dead worker", 2): 20,
}


@dataclass
class Count:
    """Counts of the trials of one kind.

    ``found`` counts files half-written after the first run; lost and doubled ones after the second;
    hidden files left behind (parts); commands that hang or are late; error outputs that are not one
    line; runs that had finished before they were ended.
    """

    trials: int = 0
    found: dict[str, int] = field(default_factory=dict)
    longest: float = 0.0

    def add(self, name: str, number: int = 1) -> None:
        """Add to a count."""
        self.found[name] = self.found.get(name, 0) + number


class Run:
    """The command in a process group of its own."""

    def __init__(self, folder: Path, workers: int) -> None:
        """Start it."""
        self.log = Path(tempfile.mkstemp(prefix="kills-")[1])
        ready, begun = os.pipe()
        self.pid = os.fork()
        if self.pid == 0:
            self._child(folder, workers, begun)
        os.close(begun)
        os.read(ready, 1)  # the command has begun, or there is none
        os.close(ready)
        with contextlib.suppress(OSError):
            os.setpgid(self.pid, self.pid)
        self.code: int | None = None

    def _child(self, folder: Path, workers: int, begun: int) -> None:
        code = 1
        try:
            os.setpgid(0, 0)
            signal.signal(signal.SIGINT, signal.default_int_handler)
            handle = os.open(self.log, os.O_WRONLY)
            os.dup2(handle, 1)
            os.dup2(handle, 2)
            sys.stderr = os.fdopen(2, "w", closefd=False)
            code = command(folder, workers, lambda: os.close(begun))
        except BaseException:
            import traceback

            os.write(2, traceback.format_exc().encode())
        finally:
            os._exit(code)

    def ended(self) -> bool:
        """Whether the command has ended."""
        if self.code is None:
            done, status = os.waitpid(self.pid, os.WNOHANG)
            if done:
                self.code = os.waitstatus_to_exitcode(status)
        return self.code is not None

    def gone(self) -> bool:
        """Whether the command and all its workers have ended."""
        if not self.ended():
            return False
        try:
            os.killpg(self.pid, 0)
        except ProcessLookupError:
            return True
        return False

    def wait(self, condition: Callable[[], bool], seconds: float = HANGS) -> float | None:
        """Seconds until the condition holds; None if it does not within ``seconds``."""
        start = time.monotonic()
        while not condition():
            if time.monotonic() - start > seconds:
                return None
            time.sleep(0.001)
        return time.monotonic() - start

    def workers(self) -> list[int]:
        """Process numbers of its children."""
        children = Path(f"/proc/{self.pid}/task/{self.pid}/children")
        try:
            return [int(pid) for pid in children.read_text().split()]
        except OSError:
            return []

    def close(self) -> None:
        """End every process that is left."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.pid, signal.SIGKILL)
        self.wait(self.gone)
        self.log.unlink()


def whole(folder: Path, truth: Path) -> tuple[int, int, int]:
    """Numbers of damaged files, of hidden ones, and of files with unexpected names."""
    bad = parts = strange = 0
    for path in folder.iterdir():
        if path.name.startswith("."):
            parts += 1
        elif not (truth / path.name).is_file():
            strange += 1
        elif path.read_bytes() != (truth / path.name).read_bytes():
            bad += 1
    return bad, parts, strange


def trial(kind: str, workers: int, base: Path, rng: np.random.Generator, count: Count) -> None:
    """End a run of this kind, then run the command again, and count what is wrong."""
    truth, folder = base / "truth", base / "disk"
    disk = contextlib.nullcontext(folder) if kind != "full disk" else small_disk(folder, truth, rng)
    folder.mkdir()
    count.trials += 1
    with disk:
        run = Run(folder, workers)
        took = ended_by(kind, workers, run, folder, rng)
        if took is None:
            count.add("hangs")
        else:
            count.longest = max(count.longest, took)
            count.add("late", took > AT_ONCE)
        judged(kind, run, folder, truth, count)
        run.close()
        if kind == "full disk":
            enlarge(folder)
        again = Run(folder, int(rng.integers(1, 3)))
        if again.wait(again.gone, 4 * HANGS) is None or again.code != 0:
            count.add("hangs")
        again.close()
        bad, parts, strange = whole(folder, truth)
        count.add("half-written", bad)
        count.add("doubled", parts + strange)
        count.add("lost", FILES - len(list(folder.glob("recording-*"))))
    shutil.rmtree(folder)


def ended_by(
    kind: str, workers: int, run: Run, folder: Path, rng: np.random.Generator
) -> float | None:
    """End the run at a random moment; seconds until all its processes have ended."""
    if kind == "full disk":  # it ends by itself, once nothing fits any more
        last = [time.monotonic(), 0.0]

        def still() -> bool:
            size = float(sum(p.stat().st_size for p in folder.iterdir() if p.exists()))
            if size != last[1]:
                last[:] = [time.monotonic(), size]
            return run.gone()

        with contextlib.suppress(FileNotFoundError):
            if run.wait(still) is None:
                return None
        run.wait(run.gone)
        return time.monotonic() - last[0]
    there = int(rng.integers(FILES))
    run.wait(lambda: run.ended() or len(list(folder.glob("recording-*"))) >= there)
    if kind == "dead worker":
        run.wait(lambda: run.ended() or len(run.workers()) >= workers)
    time.sleep(float(rng.uniform(0, 0.02)))
    with contextlib.suppress(ProcessLookupError):
        if kind == "kill -9" and rng.random() < 0.5:
            os.kill(run.pid, signal.SIGKILL)  # its workers have to see it
        elif kind == "dead worker":
            if crew := run.workers():
                os.kill(crew[int(rng.integers(len(crew)))], signal.SIGKILL)
        else:
            os.killpg(run.pid, signal.SIGKILL if kind == "kill -9" else signal.SIGINT)
    return run.wait(run.gone)


def judged(kind: str, run: Run, folder: Path, truth: Path, count: Count) -> None:
    """Check what the first run left."""
    bad, parts, strange = whole(folder, truth)
    count.add("half-written", bad + strange)
    if run.code == 0:
        count.add("finished")
    if kind == "kill -9":
        return
    count.add("parts", parts)
    lines = run.log.read_text().splitlines()
    if run.code != 0 and (len(lines) != 1 or run.code not in (2, 130)):
        count.add("wrong lines")
        print(f"exit code {run.code}:", *lines[-8:], sep="\n", flush=True)


def mounting() -> bool:
    """Whether a small disk can be mounted here (Linux, as root)."""
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            ["mount", "-t", "tmpfs", "-o", "size=64k", "none", folder], capture_output=True
        )
        if done.returncode == 0:
            subprocess.run(["umount", folder], check=True)
        return done.returncode == 0


@contextlib.contextmanager
def small_disk(folder: Path, truth: Path, rng: np.random.Generator) -> Iterator[None]:
    """A disk in memory at ``folder`` that holds less than a whole run."""
    total = sum(path.stat().st_size for path in truth.iterdir())
    size = int(rng.uniform(0.02, 0.98) * total)
    command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "none", str(folder)]
    subprocess.run(command, check=True, capture_output=True)
    try:
        yield
    finally:
        subprocess.run(["umount", str(folder)], check=True)


def enlarge(folder: Path) -> None:
    """Make room on a small disk."""
    subprocess.run(["mount", "-o", "remount,size=1g", str(folder)], check=True)
