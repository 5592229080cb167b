"""Continuous collision detection of cloth: single queries and whole frames, speed beside error."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.cloth import adversarial as cloth_adversarial
from studies.cloth import check as cloth_check
from studies.cloth import frames as cloth_frames
from studies.cloth import loose as cloth_loose
from studies.cloth import queries as cloth_queries
from studies.cloth import scaling as cloth_scaling
from studies.cloth import truth as cloth_truth
from studies.cloth.summary import summary
from studies.cloth.truth import SCENES as LISTED
from tauguard.report import Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

UNSET = (
    "TAUGUARD_DATA is not set: no recorded scenes, no listed collisions, no public queries "
    "(docs/notes/2026-11-23-cloth.md says where they come from)"
)
THERE = "TAUGUARD_DATA: scenes and query sets are there"
QUICK = "TAUGUARD_DATA: query sets are there; recorded scenes are left to a full run"

#: The chart's size [in].
SIZE = (11.0, 8.0)

#: What the columns of each table mean.
NOTES = {
    "cloth": "what is run. Times in all tables are medians of so many repeats [least, most] (of "
    "one repeat: without these); where a table says no other, the processor's, of one thread.",
    "frame": "all collisions of one step. volume: the broad phase's, (moving_)k_dopK has K/2 axes "
    "and sweeps the step (moves with it); first what each method was published with, then iccd "
    "and vcd on ab2pf's. frame_ms: broad and narrow phase; times_ab2pf: over ab2pf's; missed and "
    "added: hits that ab2pf has and the method has not, and the reverse; late: common hits whose "
    "time is more than 1e-9 after ab2pf's, late_most by how much of the step.",
    "frame mean": "times_ab2pf of the table above over its cloths (cloth-ball among them).",
    "frame mean of all": "the same over all of its scenes.",
    "frame peer": "the same step by ipctk: broad phase, then its candidates (vf_ns and ee_ns "
    "each); peer_ms is both, speedup is that over ab2pf's whole frame.",
    "query": "n candidates of ipctk's broad phase (of so many). ns: a query, gather included; "
    "misses of so many hits, false_hits of so many others; late: times after the exact one, "
    "late_most by how much of the step.",
    "query clear": "ab2pf on the candidates without contact (ab2pf_ns), and on all of them.",
    "query peer": "ns: one of n queries without contact, inside ipctk's own loop (3 repeats); "
    "all_ns: with the hits' share; misses and false_hits of so many among the queries that it was "
    "asked from Python; late_most: the latest time, in steps; us_a_hit: microseconds of a hit, "
    "asked so.",
    "truth": "whole frames beside the collisions that are listed with the data: misses and "
    "false_hits are counts; late and late_most as in the table of frames.",
    "hard query": "n public queries with exact labels. us: microseconds a query; misses and "
    "false_hits are counts; decided_exactly: left to exact arithmetic.",
    "point query": "a point and an edge, or two points: drawn from a lattice, and made to meet "
    "exactly. ns: a query, a batch a call; peer_ns: ipctk, a call each, "
    "call_ns of which is Python's; misses, false_hits, late: counts by rational arithmetic, of "
    "`known` queries; early_most: in steps.",
    "safe step": "safe_step beside ipctk's compute_collision_free_stepsize on rods, particles and "
    "triangles of one step. step, peer_step: the answers; earliest: the first contact by all pairs "
    "in exact arithmetic; meets_after: contacts that the exact method finds up to ours, and up to "
    "the peer's.",
    "adversarial": "ab2pf beside method exact. early_most: largest error of a time that is not "
    "late; scaled, turned, backwards, modes: answers that change by 2^+-300, another order of "
    "vertices, time reversed, other rounding modes.",
    "independent check": "the same queries and the public ones, all decided by integers in "
    "Python; clear_ and hit_certified: certain by intervals too; clear_tight: the former that "
    "Tight-Inclusion confirms; integers_only: the rest; contradictions: referees that differ; "
    "labels_differ: published labels that do; seconds: of all referees.",
    "volume": "frame time and candidates by kind of bounding volume.",
    "front": "tests and time a frame with the front kept, beside a fresh descent; frame_saved: of "
    "the whole frame. Wall time: means nothing on a loaded machine.",
    "size": "one frame of growing meshes, 3 repeats at most from 300,000 triangles. exponent: "
    "slope of log frame_ms over log triangles, by scene.",
    "threads": "the same frame with two threads; same_bits: nothing in the answer changes. Wall "
    "time: means nothing on a loaded machine.",
    "topology": "update_topology after so many faces changed, beside a new MeshCCD (rebuild_ms), "
    "the frame after it included; frame_ms: a frame alone. Wall time: means nothing on a loaded "
    "machine.",
}


def measure(quick: bool, seed: int) -> list[Row]:
    """Rows of every part; the recorded ones join in where ``TAUGUARD_DATA`` says where they are.

    A quick run has no recorded frames: their 6.9 million candidates take ipctk minutes.

    Raises:
        ValueError: recorded scenes or query sets are not in the folder that it names.
    """
    data = recorded()
    scenes = None if quick else data
    triangles = 4_000 if quick else 40_000
    repeats = 3 if quick else 7
    frames = cloth_frames.frames(triangles, seed, scenes)
    rows: list[Row] = [
        {
            "study": "cloth",
            "run": "quick" if quick else "full",
            "triangles": triangles,
            "repeats": repeats,
            "recorded": UNSET if data is None else QUICK if quick else THERE,
        }
    ]
    for frame in frames:
        rows += cloth_frames.methods(frame, repeats)
    rows += cloth_frames.means(rows)
    for frame in frames:
        rows += cloth_frames.peers(frame, repeats, *((5_000, 200) if quick else (10**7, 20_000)))
    for frame in frames:
        if scenes and frame.name == "cloth-ball":
            rows += cloth_queries.on_recording(frame, seed, 10**7, 20_000, repeats)
    if scenes:
        rows += cloth_truth.on_listed_frames(scenes / "ccd")
    if data:
        rows += cloth_queries.on_hard_sets(data / "ccd", 10 if quick else 60)
    rows += cloth_loose.point_queries(500 if quick else 20_000, seed, repeats)
    rows += cloth_loose.safe_steps(triangles // 10, seed, repeats)
    rows += cloth_adversarial.adversarial(3_000 if quick else 1_000_000, seed)
    if scenes:
        rows += cloth_check.on_labels(scenes / "ccd", map)
    rows += cloth_scaling.volumes(triangles, seed, repeats)
    rows += cloth_scaling.front(triangles, seed, 15 if quick else 60)
    sizes = [1_000, 10_000] if quick else [1_000, 10_000, 100_000, 1_000_000]
    rows += cloth_scaling.size(sizes, seed, repeats)
    rows += cloth_scaling.threads(triangles, seed, repeats)
    rows += cloth_scaling.topology(triangles, seed, repeats)
    return rows + summary(rows, quick, recorded=scenes is not None)


def recorded() -> Path | None:
    """The folder of ``TAUGUARD_DATA``, ``None`` where that is not set.

    Raises:
        ValueError: the variable names a folder that lacks scenes or query sets.
    """
    named = os.environ.get("TAUGUARD_DATA")
    if not named:
        return None
    folder = Path(named) / "ccd"
    needed = [f"{name}/{part}" for name in LISTED for part in ("frames", "boxes", "mma_bool")]
    needed += [
        f"{x}/{kind}" for x in cloth_queries.HARD_SETS for kind in ("vertex-face", "edge-edge")
    ]
    lacks = [name for name in needed if not any((folder / name).glob("*.*"))]
    if lacks:
        more = f" and {len(lacks) - 3} more" if len(lacks) > 3 else ""
        raise ValueError(
            f"TAUGUARD_DATA: {folder} lacks files in {', '.join(lacks[:3])}{more}; "
            "docs/notes/2026-11-23-cloth.md says where they come from; "
            "unset, the bench runs without them"
        )
    return Path(named)


def table(rows: list[Row]) -> list[Row]:
    """Rows for the printed tables: rates as counts, ``k of n``."""
    return [{key: _count(value) for key, value in row.items()} for row in rows]


def _count(value: object) -> object:
    if not isinstance(value, dict) or "n" not in value:
        return value
    return f"{round((value['value'] or 0) * value['n'])} of {value['n']}"


def draw(rows: list[Row], figure: Figure) -> None:
    """Times of the methods and of the peers, growth with size, candidates per volume."""
    axes: Any = figure.subplots(2, 2)
    if any(row["study"] == "cloth" and row["run"] == "quick" for row in rows):
        figure.suptitle("quick run: small meshes, few repeats", fontsize="medium")
    _methods(axes[0, 0], [row for row in rows if row["study"] == "frame"])
    _peers(axes[0, 1], [row for row in rows if row["study"] == "frame peer" and "speedup" in row])
    _growth(axes[1, 0], [row for row in rows if row["study"] == "size"])
    _volumes(axes[1, 1], [row for row in rows if row["study"] == "volume"])


def _methods(axes: Any, rows: list[Row]) -> None:
    """Each method on the volume that it was published with; hatched where it misses."""
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    methods = list(dict.fromkeys(row["method"] for row in rows))
    width = 0.8 / max(1, len(methods))
    for i, method in enumerate(methods):
        own = [next(r for r in rows if (r["scene"], r["method"]) == (s, method)) for s in scenes]
        at = np.arange(len(scenes)) + (i + 0.5) * width - 0.4
        label = f"{method}, {own[0]['volume'].replace('_', ' ')}"
        bars = axes.bar(at, [row["times_ab2pf"] for row in own], width, label=label)
        for bar, row in zip(bars, own, strict=True):
            if row["missed"]:
                bar.set(hatch="////", edgecolor="white", linewidth=0)
    _name_scenes(axes, scenes)
    axes.set(title="A frame, one thread (hatched: misses collisions)", ylabel="time over ab2pf's")
    axes.legend(fontsize="x-small", ncols=2, loc="upper left")


def _peers(axes: Any, rows: list[Row]) -> None:
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    for i, peer in enumerate(dict.fromkeys(row["peer"] for row in rows)):
        heights = [row["speedup"] for row in rows if row["peer"] == peer]
        bars = axes.bar(np.arange(len(scenes)) + 0.4 * i - 0.2, heights, 0.4, label=peer)
        axes.bar_label(bars, fmt="%.3g", fontsize="xx-small")
    _name_scenes(axes, scenes)
    axes.set(title="The same frame by ipctk", ylabel="time over ab2pf's", yscale="log")
    found = [row["speedup"] for row in rows] or [1.0]
    axes.set_ylim(min(1.0, 0.7 * min(found)), 5 * max(found))
    axes.axhline(1, color="black", linewidth=1)
    _plain(axes.yaxis)
    axes.legend(fontsize="x-small", loc="upper left")


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
        xticks=[6, 14, 16, 18, 26],
    )
    _plain(axes.yaxis)
    axes.legend(fontsize="x-small", loc="upper left", bbox_to_anchor=(1, 1))


def _spaced(name: str) -> str:
    return name.replace("_", " ")


def _name_scenes(axes: Any, scenes: list[str]) -> None:
    axes.set_xticks(range(len(scenes)), [_spaced(s) for s in scenes], rotation=20, ha="right")
    axes.axhline(1, color="black", linewidth=0.8, zorder=0)


def _plain(axis: Any) -> None:
    """Ticks of a logarithmic axis as plain numbers: 1, 2, 5, 10, ..."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    axis.set_minor_formatter(NullFormatter())
