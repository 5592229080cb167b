"""Continuous collision detection of cloth: single queries and whole frames, speed beside error."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tauguard.benchmarks import (
    cloth_adversarial,
    cloth_check,
    cloth_frames,
    cloth_queries,
    cloth_scaling,
    cloth_truth,
)
from tauguard.benchmarks.cloth_summary import summary
from tauguard.benchmarks.report import Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: What the columns of each table mean.
NOTES = {
    "frame": "all collisions of one step, one thread. times_ab2pf: time over ab2pf's; missed and "
    "added: hits that ab2pf has and the method has not, and the reverse.",
    "frame mean": "times_ab2pf of the table above over its scenes.",
    "frame peer": "the same step by ipctk: broad phase, then its candidates (vf_ns and ee_ns "
    "each); peer_ms is both, speedup is that over ab2pf's whole frame.",
    "query": "n candidates of ipctk's broad phase (of so many). ns: a query, gather included; "
    "late: times after the exact one.",
    "query clear": "ab2pf on the candidates without contact (ab2pf_ns), and on all of them.",
    "query peer": "ns: a query without contact, inside ipctk's own loop; all_ns: with the hits' "
    "share; misses and false_hits of the asked ones; us_a_hit: a hit, asked from Python.",
    "truth": "whole frames beside the collisions that are listed with the data.",
    "hard query": "public queries with exact labels; decided_exactly: left to exact arithmetic.",
    "adversarial": "ab2pf beside method exact. early_most: largest error of a time that is not "
    "late; scaled, turned, backwards, modes: answers that change by 2^+-300, another order of "
    "vertices, time reversed, other rounding modes.",
    "independent check": "the same queries and the public ones, all decided by integers in "
    "Python; clear_ and hit_certified: certain by intervals too; clear_tight: the former that "
    "Tight-Inclusion confirms; integers_only: the rest; contradictions: referees that differ; "
    "labels_differ: published labels that do; seconds: of all referees.",
    "volume": "frame time and candidates by kind of bounding volume, one thread.",
    "front": "tests and time a frame with the front kept, beside a fresh descent; frame_saved: of "
    "the whole frame.",
    "size": "one frame of growing meshes. exponent: slope of log frame_ms over log triangles, by "
    "scene.",
    "threads": "the same frame with two threads; same_bits: nothing in the answer changes.",
    "topology": "update_topology after so many faces changed, beside a new MeshCCD (rebuild_ms).",
}


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
            most = (40_000, 2_000) if quick else (10**7, 20_000)
            rows += cloth_queries.on_recording(frame, seed, *most, repeats)
    if data:
        rows += cloth_truth.on_listed_frames(Path(data) / "ccd")
        rows += cloth_queries.on_hard_sets(Path(data) / "ccd", 20 if quick else 60)
    rows += cloth_adversarial.adversarial(12_000 if quick else 1_000_000, seed)
    if data:
        rows += cloth_check.on_labels(Path(data) / "ccd", map)
    rows += cloth_scaling.volumes(triangles, seed, repeats)
    rows += cloth_scaling.front(triangles, seed, 15 if quick else 60)
    sizes = [1_000, 10_000] if quick else [1_000, 10_000, 100_000, 1_000_000]
    rows += cloth_scaling.size(sizes, seed, repeats)
    rows += cloth_scaling.threads(triangles, seed, repeats)
    rows += cloth_scaling.topology(triangles, seed, repeats)
    return rows + summary(rows, quick)


def draw(rows: list[Row], figure: Figure) -> None:
    """Times of the methods and of the peers, growth with size, candidates per volume."""
    axes: Any = figure.subplots(2, 2)
    _methods(axes[0, 0], [row for row in rows if row["study"] == "frame"])
    _peers(axes[0, 1], [row for row in rows if row["study"] == "frame peer" and "speedup" in row])
    _growth(axes[1, 0], [row for row in rows if row["study"] == "size"])
    _volumes(axes[1, 1], [row for row in rows if row["study"] == "volume"])


def _methods(axes: Any, rows: list[Row]) -> None:
    """Each method on the volume that it was published with, and ab2pf on its own."""
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    methods = list(dict.fromkeys(row["method"] for row in rows))
    width = 0.8 / max(1, len(methods))
    for i, method in enumerate(methods):
        own = [next(r for r in rows if (r["scene"], r["method"]) == (s, method)) for s in scenes]
        at = np.arange(len(scenes)) + (i + 0.5) * width - 0.4
        label = f"{method}, {own[0]['volume'].replace('_', ' ')}"
        axes.bar(at, [row["times_ab2pf"] for row in own], width, label=label)
        for x, row in zip(at, own, strict=True):
            if row["missed"]:
                axes.annotate("misses", (x, row["times_ab2pf"]), rotation=90, ha="center",
                              va="bottom", fontsize="xx-small")  # fmt: skip
    _name_scenes(axes, scenes)
    axes.set(title="A frame, all collisions, one thread", ylabel="time over ab2pf's")
    axes.legend(fontsize="x-small", ncols=2)


def _peers(axes: Any, rows: list[Row]) -> None:
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    for i, peer in enumerate(dict.fromkeys(row["peer"] for row in rows)):
        heights = [row["speedup"] for row in rows if row["peer"] == peer]
        bars = axes.bar(np.arange(len(scenes)) + 0.4 * i - 0.2, heights, 0.4, label=peer)
        axes.bar_label(bars, fmt="%.3g", fontsize="xx-small")
    _name_scenes(axes, scenes)
    axes.set(title="The same frame by ipctk", ylabel="time over ab2pf's", yscale="log")
    axes.set_ylim(1, 3 * max((row["speedup"] for row in rows), default=1))
    _plain(axes.yaxis)
    axes.legend(fontsize="x-small")


def _growth(axes: Any, rows: list[Row]) -> None:
    for name in dict.fromkeys(row["scene"] for row in rows):
        own = [row for row in rows if row["scene"] == name]
        axes.loglog(
            [row["triangles"] for row in own],
            [row["frame_ms"]["median"] for row in own],
            marker="o",
            label=f"{_spaced(name)}: n^{own[-1]['exponent']:.2f}",
        )
    axes.set(title="Growth with the mesh", xlabel="triangles n", ylabel="ms a frame")
    _plain(axes.yaxis)
    axes.legend(fontsize="x-small")


def _volumes(axes: Any, rows: list[Row]) -> None:
    for i, name in enumerate(dict.fromkeys(row["scene"] for row in rows)):
        for prefix, style in (("k_dop", "-"), ("moving_k_dop", "--")):
            own = [r for r in rows if r["scene"] == name and r["volume"].startswith(prefix)]
            candidates = [row["vf_candidates"] + row["ee_candidates"] for row in own]
            label = _spaced(name) if style == "-" else None
            k = [int(row["volume"].removeprefix(prefix)) for row in own]
            axes.semilogy(k, candidates, style, marker="o", color=f"C{i}", label=label)
    axes.set(
        title="Candidates left (dashed: volumes that move)",
        xlabel="k of the k-DOP",
        ylabel="pairs",
        xticks=[6, 14, 18, 26],
    )
    _plain(axes.yaxis)
    axes.legend(fontsize="x-small")


def _spaced(name: str) -> str:
    return name.replace("_", " ")


def _name_scenes(axes: Any, scenes: list[str]) -> None:
    axes.set_xticks(range(len(scenes)), [_spaced(s) for s in scenes], rotation=20, ha="right")
    axes.axhline(1, color="black", linewidth=0.8)


def _plain(axis: Any) -> None:
    """Ticks of a logarithmic axis as plain numbers: 1, 2, 5, 10, ..."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    axis.set_minor_formatter(NullFormatter())
