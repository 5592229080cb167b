"""Reading a folder of labelled recordings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tauguard.traces import Trace


def labelled(folder: Path) -> list[Trace]:
    """All MCAP recordings of a folder, in the order of their names.

    Raises:
        ValueError: no recordings there, or one without truth (named).
        FileNotFoundError: no such folder.
    """
    from tqdm import tqdm

    from tauguard.traces import read_mcap

    if not folder.is_dir():
        raise FileNotFoundError(f"{folder}: no such folder; `tauguard simulate --out` makes one")
    paths = sorted(folder.glob("*.mcap"))
    if not paths:
        raise ValueError(f"{folder}: no .mcap files; `tauguard simulate --out` writes some")
    traces = []
    for path in tqdm(paths, desc="read", unit="file", disable=None, leave=False):
        trace, _ = read_mcap(path)
        if trace.truth is None:
            raise ValueError(f"{path}: no truth in it; simulated recordings have one")
        traces.append(trace)
    return traces
