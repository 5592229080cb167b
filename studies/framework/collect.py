"""Every part in a process of its own, into a folder; what is there already is not run again."""

from __future__ import annotations

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

#: Quick parts at a time: one a core of the smallest machine.
TOGETHER = 2
#: What a file of rows holds beside them.
FIELDS = ("name", "quick", "machine", "versions", "seed", "rows")
#: What it says of the machine.
MACHINE = ("processor", "cores", "system")


def collect(folder: Path, names: Iterable[str], *, quick: bool, seed: int) -> dict[str, str]:
    """Run the parts ``names`` that ``folder`` does not hold with these settings and versions.

    Each leaves ``NAME.json``, ``NAME.png`` and ``NAME.log``; a file that no part wrote is left as
    it is. Full parts run alone, since others would disturb their times. Returns why each part
    failed that did: its last line, or what is wrong with the file that is there.
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
        pool.shutdown(cancel_futures=True)  # at Ctrl-C those that have not begun do not begin
    found = zip(missing, reasons, strict=True)
    return failed | {name: reason for name, reason in found if reason is not None}


def _there(path: Path, name: str, quick: bool, seed: int) -> bool:
    """Whether the file holds what this run would; ``ValueError`` if no part wrote it."""
    if not path.exists():
        return False
    found = read_rows(path, name)
    same = (found["quick"], found["seed"], found["versions"]) == (quick, seed, versions())
    return same and "incomplete" not in found


def _run(folder: Path, name: str, quick: bool, seed: int) -> str | None:
    """Run a part, and return why it failed."""
    start = time.monotonic()
    command = [sys.executable, "-m", "tauguard", "bench", name, "--seed", str(seed)]
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
    """The file that the part ``name`` wrote; ``ValueError`` says what is wrong with another."""
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
