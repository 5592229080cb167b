"""Every study, one process each, into a folder; what is there already is not run again."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

from studies.study_file import read_study
from tauguard.report import versions

#: Quick studies at a time: one a core of the smallest machine.
TOGETHER = 2


def collect(folder: Path, names: Iterable[str], *, quick: bool, seed: int) -> dict[str, str]:
    """Run the studies ``names`` that ``folder`` does not hold of these settings and versions.

    Each leaves ``NAME.json``, ``NAME.png`` and ``NAME.log``. A study that fails does not stop the
    others. A file of that name which no study wrote is left as it is. Quick studies run
    :data:`TOGETHER` at a time, full ones alone, since others would disturb their times.

    Returns:
        Why, for each study that failed: the last line that it printed, or what is wrong with the
        file that is there.
    """
    folder.mkdir(parents=True, exist_ok=True)
    failed: dict[str, str] = {}
    missing: list[str] = []
    for name in names:
        try:
            there = _there(folder / f"{name}.json", name, quick, seed)
        except (OSError, ValueError) as error:
            failed[name] = f"{error}; move it away"
            print(f"{name}: {failed[name]}", flush=True)
            continue
        if there:
            print(f"{name}: there already")
        else:
            missing.append(name)
    run = partial(_reported, folder, quick=quick, seed=seed)
    pool = ThreadPoolExecutor(TOGETHER)
    try:
        reasons = list(pool.map(run, missing) if quick else map(run, missing))
    finally:
        pool.shutdown(cancel_futures=True)  # at Ctrl-C those that have not begun do not begin
    found = zip(missing, reasons, strict=True)
    return failed | {name: reason for name, reason in found if reason is not None}


def _reported(folder: Path, name: str, quick: bool, seed: int) -> str | None:
    """Run a study, and say how it ended."""
    start = time.monotonic()
    reason = _study(folder, name, quick, seed)
    print(f"{name}: {reason or 'done'}, {time.monotonic() - start:.0f} s", flush=True)
    return reason


def _there(path: Path, name: str, quick: bool, seed: int) -> bool:
    """Whether the file holds what this run would; ``ValueError`` if it is no study's."""
    if not path.exists():
        return False
    found = read_study(path, name)
    same = (found["quick"], found["seed"], found["versions"]) == (quick, seed, versions())
    return same and "incomplete" not in found


def _study(folder: Path, name: str, quick: bool, seed: int) -> str | None:
    command = [sys.executable, "-m", "tauguard", "bench", name, "--seed", str(seed)]
    command += ["--json", str(folder / f"{name}.json"), "--figure", str(folder / f"{name}.png")]
    log = folder / f"{name}.log"
    with log.open("w") as out:
        done = subprocess.run(
            [*command, *(["--quick"] if quick else [])], stdout=out, stderr=subprocess.STDOUT
        )
    if done.returncode == 0:
        return None
    lines = log.read_text().strip().splitlines()
    return lines[-1] if lines else f"it ended with code {done.returncode}"
