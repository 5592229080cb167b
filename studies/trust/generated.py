"""``tauguard generate`` killed (SIGKILL) at random moments: the same bytes when it goes on."""

from __future__ import annotations

import contextlib
import hashlib
import os
import signal
import subprocess
import sys
import tempfile
import textwrap
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tauguard.datasets.configuration import load
from tauguard.datasets.generation import generate_dataset
from tauguard.report import Row

#: A dataset of many small shards: most moments are in the middle of one.
SMALL = """
    name = "small"
    seed = {seed}
    rate = 500
    episodes_per_shard = 1
    residual = true
    [episodes]
    seconds = 6.6
    arms = ["cura6", "cura6-long"]
    individuals = [0, 1]
    speeds = [20, 50]
    payloads_g = [0, 1000]
    severities = [[8, 64]]
    [[splits]]
    name = "train"
    episodes = 6
"""


#: Kills with each number of workers, in a full and in a quick run.
KILLS = (20, 1)


def kill_rows(quick: bool, seed: int) -> list[Row]:
    """A row a number of workers."""
    return [killed(workers, KILLS[quick], seed) for workers in (1, 2)]


def killed(workers: int, count: int, seed: int) -> Row:
    """Kill a command ``count`` times, each in a folder of its own, and let it go on.

    Args:
        workers: processes that compute.
        count: kills.
        seed: of the dataset and of the moments.
    """
    rng = np.random.default_rng([seed, 81])
    same, midway = 0, 0
    with small_dataset(seed) as (config, wanted):
        timed = config.parent / "timed"
        begun, ended = _timed(config, timed, workers)
        assert contents(timed) == wanted, "differs without a kill"
        for number in range(count):
            folder = config.parent / f"killed-{number}"
            command = start(config, folder, "--workers", str(workers))
            _wait(folder, command)
            time.sleep(rng.uniform(0, 1.1 * (ended - begun)))
            os.killpg(command.pid, signal.SIGKILL)
            midway += command.wait() != 0
            generate_dataset(load(config), folder, workers=1)
            same += contents(folder) == wanted
    return {
        "study": "generate",
        "workers": workers,
        "kills": count,
        "before it ended": midway,
        "same bytes": same,
    }


@contextlib.contextmanager
def small_dataset(seed: int) -> Iterator[tuple[Path, dict[str, str]]]:
    """Its configuration, in a folder for more, and the :func:`contents` that one process writes."""
    with tempfile.TemporaryDirectory() as place:
        config = Path(place) / "small.toml"
        config.write_text(textwrap.dedent(SMALL.format(seed=seed)))
        wanted = Path(place) / "wanted"
        generate_dataset(load(config), wanted, workers=1)
        yield config, contents(wanted)


def contents(folder: Path) -> dict[str, str]:
    """SHA-256 of every file by its name in the folder."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def start(config: Path, folder: Path, *flags: str) -> subprocess.Popen[bytes]:
    """``tauguard generate`` with these flags, as a process group of its own."""
    program = "from tauguard.cli import main; main()"
    return subprocess.Popen(
        [sys.executable, "-c", program, "generate", str(config), "--out", str(folder), *flags],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def _wait(folder: Path, command: subprocess.Popen[bytes]) -> None:
    """Until the dataset is begun: before that there is nothing to lose."""
    while not (folder / "dataset.json").exists() and command.poll() is None:
        time.sleep(0.002)


def _timed(config: Path, folder: Path, workers: int) -> tuple[float, float]:
    """When the dataset is begun and when the command ends, of a run that is left alone."""
    command = start(config, folder, "--workers", str(workers))
    _wait(folder, command)
    begun = time.monotonic()
    if command.wait() != 0:
        raise RuntimeError(f"tauguard generate --workers {workers} failed")
    return begun, time.monotonic()
