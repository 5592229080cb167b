"""Reading a folder of labelled recordings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from tqdm import tqdm

from tauguard.datasets.arm_splits import training
from tauguard.datasets.log_checks import checked
from tauguard.datasets.reader import is_dataset
from tauguard.traces import Trace, read_mcap
from tauguard.untrusted_input import reading


def labelled(folder: Path, arm: str | None = None) -> list[Trace]:
    """All MCAP recordings of a folder, in the order of their names; of a dataset its first split.

    ``meta["log"]`` of a recording is the name of its file.

    Args:
        folder: of recordings, or a dataset that `tauguard generate` made.
        arm: of a dataset with several arms, whose episodes.

    Raises:
        ValueError: no recordings there, or one without truth (named).
        FileNotFoundError: no such folder.
    """
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder}: no such folder; `tauguard simulate --out` makes one")
    if is_dataset(folder):
        return training(folder, arm)
    if arm is not None:
        raise ValueError(f"--arm {arm}: {folder} is no dataset, so its recordings are of one arm")
    paths = sorted(folder.glob("*.mcap"))
    if not paths:
        raise ValueError(f"{folder}: no .mcap files; `tauguard simulate --out` writes some")
    traces = []
    for path in tqdm(paths, desc="read", unit="file", disable=None, leave=False):
        trace, _ = read_mcap(path)
        if trace.truth is None:
            raise ValueError(f"{path}: no truth in it; simulated recordings have one")
        with reading(path):  # a gap is no watched time, here as in logs
            checked(trace, lambda row: f"sample {row}")
        traces.append(replace(trace, meta={**trace.meta, "log": path.name}))
    return traces
