"""Tasks that write recordings, to be interrupted. Light imports: workers start at once."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tauguard.datasets.workers import Terminated, writing
from tauguard.traces import Trace, read_mcap, write_mcap

#: Recordings of one run, and samples of one: about 6 MB together.
FILES, ROWS = 8, 5000


def write_one(task: tuple[str, int]) -> int:
    """Write the recording of this number into the folder, unless it is there."""
    folder, number = task
    path = Path(folder) / f"recording-{number}.mcap"
    if not path.exists():
        rng = np.random.default_rng(number)
        q, qd, current, wanted = rng.normal(size=(4, ROWS, 6))
        names = tuple(f"joint_{k}" for k in range(6))
        t = np.arange(ROWS, dtype=np.float64) * 1e-3
        write_mcap(path, Trace(names, t, q, qd, current, qd_des=wanted))
    read_mcap(path)
    return number


def command(folder: Path, workers: int, begun: Callable[[], None] = lambda: None) -> int:
    """What a command does with such tasks; its exit code. ``begun`` is called at its beginning."""
    try:
        begun()
        todo = [(str(folder), number) for number in range(FILES)]
        with writing(write_one, todo, workers, folder) as results:
            for _ in results:
                pass
    except KeyboardInterrupt as stop:
        print("stopped", file=sys.stderr, flush=True)
        return 143 if isinstance(stop, Terminated) else 130
    except (ValueError, OSError) as error:
        print(error, file=sys.stderr, flush=True)
        return 2
    return 0
