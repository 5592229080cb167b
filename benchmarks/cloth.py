"""Continuous collision detection of cloth: single queries and whole frames, speed beside error."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tauguard.benchmarks import cloth_adversarial, cloth_frames, cloth_queries, cloth_scaling
from tauguard.benchmarks.cloth_summary import summary
from tauguard.benchmarks.report import Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def run(quick: bool, seed: int) -> list[Row]:
    """Rows of every part; the real scene joins in where ``TAUGUARD_DATA`` says where it is."""
    data = os.environ.get("TAUGUARD_DATA")
    triangles = 4_000 if quick else 40_000
    repeats = 3 if quick else 7
    frames = cloth_frames.frames(triangles, seed, Path(data) if data else None)
    rows: list[Row] = []
    for frame in frames:
        few = 1 if quick and len(frame.faces) > 50_000 else repeats
        rows += cloth_frames.methods(frame, few)
    rows += cloth_frames.means(rows)
    for frame in frames:
        rows += cloth_frames.peers(frame, repeats, *((20_000, 500) if quick else (10**7, 20_000)))
    for frame in frames:
        if data and frame.name == "cloth-ball":
            most = (40_000, 400) if quick else (10**7, 20_000)
            rows += cloth_queries.on_recording(frame, seed, *most, repeats)
    if data:
        rows += cloth_queries.on_hard_sets(Path(data) / "ccd", 20 if quick else 60)
    rows += cloth_adversarial.adversarial(12_000 if quick else 1_000_000, seed)
    rows += cloth_scaling.volumes(triangles, seed, repeats)
    rows += cloth_scaling.front(triangles, seed, 15 if quick else 60)
    sizes = [1_000, 10_000] if quick else [1_000, 10_000, 100_000, 1_000_000]
    rows += cloth_scaling.size(sizes, seed, repeats)
    rows += cloth_scaling.threads(triangles, seed, repeats)
    rows += cloth_scaling.topology(triangles, seed, repeats)
    return rows + summary(rows)


def draw(rows: list[Row], figure: Figure) -> None:
    """Time per scene and method, ratio to the peers, growth with size, candidates per volume."""
    axes: Any = figure.subplots(2, 2)
    _bars(axes[0, 0], [row for row in rows if row["study"] == "frame"])
    _peers(axes[0, 1], [row for row in rows if row["study"] == "frame peer" and "speedup" in row])
    _growth(axes[1, 0], [row for row in rows if row["study"] == "size"])
    _volumes(axes[1, 1], [row for row in rows if row["study"] == "volume"])


def _bars(axes: Any, rows: list[Row]) -> None:
    names = list(dict.fromkeys(row["scene"] for row in rows))
    entries = list(dict.fromkeys((row["method"], row["volume"]) for row in rows))
    width = 0.8 / max(1, len(entries))
    for i, entry in enumerate(entries):
        heights = [
            row["frame_ms"]["median"] for row in rows if (row["method"], row["volume"]) == entry
        ]
        axes.bar(np.arange(len(names)) + i * width, heights, width, label=" ".join(entry))
    axes.set_xticks(np.arange(len(names)) + 0.4, names, rotation=20, ha="right")
    axes.set(title="One frame, all collisions, one thread", ylabel="ms", yscale="log")
    axes.legend(fontsize="x-small", ncols=2)


def _peers(axes: Any, rows: list[Row]) -> None:
    names = list(dict.fromkeys(row["scene"] for row in rows))
    peers = list(dict.fromkeys(row["peer"] for row in rows))
    for i, peer in enumerate(peers):
        heights = [row["speedup"] for row in rows if row["peer"] == peer]
        axes.bar(np.arange(len(names)) + 0.4 * i, heights, 0.4, label=peer)
    axes.set_xticks(np.arange(len(names)) + 0.2, names, rotation=20, ha="right")
    axes.set(title="Peer's time over ab2pf's, same frame", ylabel="times", yscale="log")
    axes.legend(fontsize="x-small")


def _growth(axes: Any, rows: list[Row]) -> None:
    for name in dict.fromkeys(row["scene"] for row in rows):
        own = [row for row in rows if row["scene"] == name]
        exponent = own[-1]["exponent"]
        axes.loglog(
            [row["triangles"] for row in own],
            [row["frame_ms"]["median"] for row in own],
            marker="o",
            label=f"{name}: n^{exponent:.2f}",
        )
    axes.set(title="Growth with the mesh", xlabel="triangles", ylabel="ms a frame")
    axes.legend(fontsize="x-small")


def _volumes(axes: Any, rows: list[Row]) -> None:
    for name in dict.fromkeys(row["scene"] for row in rows):
        own = [row for row in rows if row["scene"] == name]
        candidates = [row["vf_candidates"] + row["ee_candidates"] for row in own]
        axes.semilogy([row["volume"] for row in own], candidates, marker="o", label=name)
    axes.tick_params(axis="x", rotation=30)
    axes.set(title="Candidates that a volume leaves", ylabel="pairs")
    axes.legend(fontsize="x-small")
