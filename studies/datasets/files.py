"""What the files of a dataset take: bytes an hour, the reading of a column, peak memory."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from studies.framework import time_in_turn
from tauguard.datasets.configuration import Configuration, load, parse
from tauguard.datasets.generation import generate_dataset
from tauguard.report import Row

#: Rows a second whose bytes are told.
RATES = (1000, 500, 100)
#: Episodes of the runs whose memory is compared.
COUNTS, QUICK_COUNTS = (100, 1000, 10_000), (10, 50)
#: A run in a process of its own: peak memory of it and of its workers. The peak of a process in
#: ``getrusage`` counts what its parent had when it started, that in ``/proc`` does not.
RUN = """
import json, resource, sys
from pathlib import Path
from tauguard.datasets.configuration import Configuration
from tauguard.datasets.generation import generate_dataset
if __name__ == "__main__":
    generate_dataset(Configuration.from_json(Path(sys.argv[1]).read_text()), Path(sys.argv[2]), 2)
    own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    status = Path("/proc/self/status")
    if status.exists():
        own = int(status.read_text().partition("VmHWM:")[2].split()[0])
    worker = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    print(json.dumps([own / 1024, worker / 1024]))
"""


def size_rows(quick: bool, seed: int) -> list[Row]:
    """MB an hour with and without residual, and one column read by pyarrow and by pandas."""
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as place:
        for rate in RATES:
            for residual in (False, True):
                folder = Path(place) / f"{rate}-{residual}"
                configuration = _some(quick, seed, rate, residual)
                generate_dataset(configuration, folder, workers=1)
                files = sorted(folder.glob("data/*.parquet"))
                size = sum(path.stat().st_size for path in files) / 1e6
                name = f"{rate} Hz{', residual' if residual else ''}"
                hour = size / configuration.hours
                rows.append({"study": "size", "rows a second": name, "MB an hour": hour})
                if rate == max(RATES) and residual:
                    rows.append(_read(files[0]))
    return rows


def memory_rows(quick: bool, seed: int) -> list[Row]:
    """Peak resident memory of the command and of its largest worker, by number of episodes."""
    rows: list[Row] = []
    for count in QUICK_COUNTS if quick else COUNTS:
        with tempfile.TemporaryDirectory() as place:
            text = Path(place) / "configuration.json"
            text.write_text(_short(count, seed).to_json())
            program = Path(place) / "run.py"
            program.write_text(RUN)
            done = subprocess.run(
                [sys.executable, str(program), str(text), str(Path(place) / "data")],
                capture_output=True,
                check=True,
            )
        parent, worker = json.loads(done.stdout)
        rows.append(
            {"study": "memory", "episodes": count, "command [MiB]": parent, "worker [MiB]": worker}
        )
    return rows


def _some(quick: bool, seed: int, rate: int, residual: bool) -> Configuration:
    whole = load("tauguard-collisions-v1")
    split = replace(whole.splits[0], episodes=12)
    if quick:
        split = replace(split, episodes=1, seconds=20.0, collisions=5)
    return replace(whole, seed=seed, rate=rate, residual=residual, splits=(split,))


def _short(count: int, seed: int) -> Configuration:
    split = {"name": "train", "episodes": count, "seconds": 1.0, "struck": 0.0, "speeds": [30]}
    arm = {"arms": ["cura6"], "individuals": [0]}
    top = {"name": "short", "seed": seed, "rate": 100, "episodes_per_shard": 20}
    return parse({**top, "splits": [{**split, **arm}]})


def _read(path: Path) -> Row:
    """One column of a shard: megabytes of float32 a second."""
    column = "current_2"
    rows = pq.ParquetFile(path).metadata.num_rows
    calls = {"pyarrow": lambda: pq.read_table(path, columns=[column])}
    row: Row = {"study": "read", "rows": rows}
    try:
        import pandas  # type: ignore[import-untyped, import-not-found, unused-ignore]
    except ImportError:
        row["pandas"] = "not installed"
    else:
        calls["pandas"] = lambda: pandas.read_parquet(path, columns=[column])
        ours = calls["pyarrow"]()[column].to_numpy()
        row["equal"] = bool(np.array_equal(ours, calls["pandas"]()[column].to_numpy()))
    for name, time in time_in_turn(calls, repeats=7).items():
        row[f"{name} [MB/s]"] = 4e-6 * rows / time["median"]
    return row
