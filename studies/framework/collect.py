"""Run every part in a separate process, and write its files into a folder."""

import json
import subprocess
import sys
import time
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

from tauguard.report import versions

#: Number of quick parts that run at once: the smallest machine has two cores.
TOGETHER = 2
#: Keys of a part's file.
FIELDS = ("name", "quick", "machine", "versions", "seed", "rows")
#: Keys of ``machine`` in a part's file.
MACHINE = ("processor", "cores", "system")


def collect(folder: Path, names: Iterable[str], *, quick: bool, seed: int) -> dict[str, str]:
    """Run the parts ``names`` that ``folder`` does not hold with these settings and versions.

    Each part writes ``NAME.json``, ``NAME.png`` and ``NAME.log``. Files that no part wrote stay
    unchanged. Full parts run one at a time, since others would disturb their times. Returns the
    parts that failed, each with its last line or with what is wrong with its existing file.
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
    run = partial(_run, folder, quick=quick, seed=seed)
    pool = ThreadPoolExecutor(TOGETHER)
    try:
        reasons = list(pool.map(run, missing) if quick else map(run, missing))
    finally:
        pool.shutdown(cancel_futures=True)  # at Ctrl-C no further part begins
    found = zip(missing, reasons, strict=True)
    return failed | {name: reason for name, reason in found if reason is not None}


def _there(path: Path, name: str, quick: bool, seed: int) -> bool:
    """Whether the file holds a complete result of this run; ``ValueError`` if no part wrote it."""
    if not path.exists():
        return False
    found = read_rows(path, name)
    same = (found["quick"], found["seed"], found["versions"]) == (quick, seed, versions())
    return same and "incomplete" not in found


def _run(folder: Path, name: str, quick: bool, seed: int) -> str | None:
    """Run a part, and return why it failed."""
    start = time.monotonic()
    command = [sys.executable, "-m", "studies", "bench", name, "--seed", str(seed)]
    command += ["--json", str(folder / f"{name}.json"), "--figure", str(folder / f"{name}.png")]
    log = folder / f"{name}.log"
    with log.open("w") as out:
        done = subprocess.run(
            [*command, *(["--quick"] if quick else [])], stdout=out, stderr=subprocess.STDOUT
        )
    reason = None
    if done.returncode != 0:
        lines = log.read_text().strip().splitlines()
        reason = lines[-1] if lines else f"it ended with code {done.returncode}"
    print(f"{name}: {reason or 'done'}, {time.monotonic() - start:.0f} s", flush=True)
    return reason


def read_rows(path: Path, name: str) -> dict[str, Any]:
    """Read the file of the part ``name``; ``ValueError`` says what is wrong with it."""
    try:
        found = json.loads(path.read_text())
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path.name} is no JSON file ({error})") from None
    if not isinstance(found, dict):
        wrong = "it holds no object"
    elif not set(FIELDS) <= set(found):
        wrong = f"{next(field for field in FIELDS if field not in found)!r} is missing"
    elif found["name"] != name:
        wrong = f"it says {found['name']!r:.40}"
    elif not isinstance(found["machine"], dict) or not set(MACHINE) <= set(found["machine"]):
        wrong = f"'machine' lacks one of {', '.join(MACHINE)}"
    elif not isinstance(found["rows"], list) or not all(isinstance(r, dict) for r in found["rows"]):
        wrong = "a row is no object"
    else:
        return found
    raise ValueError(f"{path.name} is no file of this study: {wrong}")
