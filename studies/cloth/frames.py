"""Whole frames: every method and ipctk, with misses, false hits and late times.

All methods run in one thread. Times are processor times.
"""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from time import process_time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from oracles.recorded_collisions import FRAMES, keys, load_frame
from studies.cloth import shared
from studies.cloth.shared import CLOTHS, Step
from studies.framework import answer, per, table_rows, time_in_turn, timed
from tauguard.cloth import Frame as FrameAnswer
from tauguard.cloth import Groups
from tauguard.cloth.comparators import METHODS
from tauguard.cloth.comparators import ComparedMeshCCD as MeshCCD
from tauguard.cloth.scenes import SCENES
from tauguard.report import Row

#: Pairs of method and volume: first as published, then all on the same candidates.
ENTRIES = [
    ("ab2pf", "auto"),
    *((method, "k_dop18") for method in ("iccd", "dnf", "scd", "vcd", "naive", "ab2pf")),
    *((method, "auto") for method in ("iccd", "vcd")),
]
#: Targets of the mean ratio of frame times, comparator / ab2pf, with the comparator's own volume.
MEANS = {"iccd": 2.3, "vcd": 1.34}
#: The peer, and the target of the ratio of times, peer / ab2pf, on a frame of cloth-ball.
PEER = ("ipctk LBVH + AdditiveCCD", 10)
#: A time of impact is late if it exceeds that of ab2pf by this, the largest error of ab2pf [step].
LATE = 1e-9
RECORDED = "cloth-ball"  #: the recorded scene with a target

NOTES = {
    "frame": "all collisions of one step. volume: bounding volume; k_dopK has K/2 axes and bounds "
    "the whole step, moving_k_dopK has bounds at each end, and auto chooses by the motion. First "
    "each method with its published volume, then iccd and vcd with that of ab2pf. times_ab2pf: "
    "time / time of ab2pf. missed: hits of ab2pf that the method lacks; added: hits that ab2pf "
    "lacks. late: common hits whose time is more than 1e-9 after ab2pf's; late_most: largest such "
    "difference, as a fraction of the step.",
    "frame mean": "mean of times_ab2pf over the cloths of the table above, including cloth-ball.",
    "frame peer": "the same step by ipctk: broad phase, then a time per candidate (vf_ns, ee_ns). "
    "speedup: time of both phases / time of ab2pf's whole frame.",
    "listed": "hits compared with the collisions that the authors of the frames list; late as "
    "above.",
}


class Frame(NamedTuple):
    """One step of a mesh."""

    name: str
    faces: NDArray[np.int32]
    groups: Groups | None
    step: Step


def measure(quick: bool, seed: int) -> list[Row]:
    """Measure generated scenes and, in a full run, the recorded ones in ``TAUGUARD_DATA``.

    A quick run has no recorded frames: their 6.9 million candidates take ipctk minutes.
    """
    data = None if quick else shared.recorded()
    triangles, repeats = (4_000, 3) if quick else (40_000, 7)
    built = [build(triangles, seed) for build in SCENES.values()]
    frames = [Frame(s.name, s.faces, s.groups, shared.step_at(s, 0.85)) for s in built]
    if data is not None:
        real = load_frame(data, RECORDED)
        frames.append(Frame(RECORDED, real.faces, None, (real.x_t0, real.x_t1)))
    rows = [shared.run_row(quick, triangles=triangles, repeats=repeats, recorded=data is not None)]
    for frame in frames:
        rows += _methods(frame, repeats)
    rows += _means(rows)
    for frame in frames:
        rows += _peers(frame, repeats, *((5_000, 200) if quick else (10**7, 20_000)))
    return rows + (_listed(data) if data is not None else [])


def _methods(frame: Frame, repeats: int) -> list[Row]:
    """A row for every method on one frame.

    ab2pf is the reference: its hits on the recorded frames are exactly the listed ones.
    """
    reference = MeshCCD(frame.faces, groups=frame.groups).find(*frame.step)
    meshes = {
        entry: MeshCCD(frame.faces, entry[0], groups=frame.groups, volume=entry[1])
        for entry in ENTRIES
    }
    calls = {" ".join(entry): partial(ccd.find, *frame.step) for entry, ccd in meshes.items()}
    times = time_in_turn(calls, repeats, process_time)
    ours = times[" ".join(ENTRIES[0])]["median"]
    rows: list[Row] = []
    for entry, ccd in meshes.items():
        found, time = ccd.find(*frame.step), times[" ".join(entry)]
        missed, added = differences((reference.vf, reference.ee), (found.vf, found.ee))
        rows.append(
            {
                "study": "frame",
                "scene": frame.name,
                "triangles": len(frame.faces),
                "method": entry[0],
                "volume": entry[1],
                "frame_ms": per(time, 1, 1e3),
                "times_ab2pf": time["median"] / ours,
                "candidates": found.stats.vf["candidates"] + found.stats.ee["candidates"],
                "ab2pf_hits": len(reference.vf) + len(reference.ee),
                "missed": missed,
                "added": added,
                **lateness(reference, found),
            }
        )
    return rows


def _means(rows: Sequence[Row]) -> list[Row]:
    """Mean ratio of times of each method over the scenes with cloth."""
    cloths = [row for row in table_rows(rows, "frame") if row["scene"] in (*CLOTHS, RECORDED)]
    means: list[Row] = []
    for method, volume in ENTRIES:
        own = [row for row in cloths if (row["method"], row["volume"]) == (method, volume)]
        ratios = [row["times_ab2pf"] for row in own]
        means.append(
            {
                "study": "frame mean",
                "method": method,
                "volume": volume,
                "scenes": len(own),
                "times_ab2pf_mean": float(np.mean(ratios)),
                "times_ab2pf_least": min(ratios),
                "times_ab2pf_most": max(ratios),
                "missed": sum(row["missed"] for row in own),
                "late": sum(row["late"] for row in own),
            }
        )
    return means


def _peers(frame: Frame, repeats: int, limit: int, tight_limit: int) -> list[Row]:
    """ipctk's LBVH and narrow phases on the same frame.

    The narrow phase is timed in its own C++ loop over up to ``limit`` candidates without contact,
    because a hit would shorten the step for the candidates after it. The time per candidate is
    multiplied by the number of all candidates, although hits take longer. Neither side uses groups.
    """
    ipctk = shared.load_ipctk()
    if ipctk is None:
        return [{"study": "frame peer", "scene": frame.name, "peer": "ipctk is not installed"}]
    ccd = MeshCCD(frame.faces)
    found = ccd.find(*frame.step)
    x_t0, x_t1 = (np.asfortranarray(x) for x in frame.step)
    mesh, candidates = ipctk.CollisionMesh(x_t0, ccd.edges, frame.faces), ipctk.Candidates()
    calls: dict[str, Callable[[], object]] = {
        "ours": partial(ccd.find, *frame.step),
        "LBVH": lambda: candidates.build(mesh, x_t0, x_t1, 0.0, ipctk.LBVH()),
    }
    times = time_in_turn(calls, repeats, process_time)
    lists = {"fv": candidates.fv_candidates, "ee": candidates.ee_candidates}  # copies of millions
    rows: list[Row] = []
    for (name, method), most in zip(
        shared.narrow_phases(ipctk).items(), (limit, tight_limit), strict=True
    ):
        seconds, total = {}, times["LBVH"]["median"]
        for kind, every in lists.items():
            part = ipctk.Candidates()
            clear = _clear(kind, every, found, most)
            setattr(part, f"{kind}_candidates", clear)
            start = process_time()
            part.compute_collision_free_stepsize(mesh, x_t0, x_t1, 0.0, method)
            seconds[kind] = (process_time() - start) / max(1, len(clear))
            total += seconds[kind] * len(every)
        rows.append(
            {
                "study": "frame peer",
                "scene": frame.name,
                "peer": f"ipctk LBVH + {name}",
                "peer_candidates": sum(map(len, lists.values())),
                "broad_ms": per(times["LBVH"], 1, 1e3),
                "vf_ns": 1e9 * seconds["fv"],
                "ee_ns": 1e9 * seconds["ee"],
                "peer_ms": 1e3 * total,
                "ab2pf_ms": per(times["ours"], 1, 1e3),
                "speedup": total / times["ours"]["median"],
            }
        )
    return rows


def _clear(kind: str, candidates: list[Any], found: FrameAnswer, most: int) -> list[Any]:
    """Up to ``most`` candidates without contact, evenly over the list."""

    def ids(one: Any) -> tuple[int, int]:
        if kind == "fv":
            return one.vertex_id, one.face_id
        return min(one.edge0_id, one.edge1_id), max(one.edge0_id, one.edge1_id)

    hits = {tuple(pair) for pair in (found.vf if kind == "fv" else found.ee).tolist()}
    return [one for one in candidates[:: 1 + len(candidates) // most] if ids(one) not in hits]


def _listed(data: Path) -> list[Row]:
    """Compare every method with the listed collisions; "exact" runs only on small meshes."""
    rows: list[Row] = []
    for name in FRAMES:
        frame = load_frame(data, name)
        ours = MeshCCD(frame.faces).find(frame.x_t0, frame.x_t1)
        for method in METHODS:
            if method == "exact" and len(frame.faces) > 50_000:
                continue
            found = MeshCCD(frame.faces, method).find(frame.x_t0, frame.x_t1)
            missed, added = differences(frame.hits, (found.vf, found.ee))
            rows.append(
                {
                    "study": "listed",
                    "scene": name,
                    "method": method,
                    "listed": sum(map(len, frame.hits)),
                    "misses": missed,
                    "false_hits": added,
                    **lateness(ours, found),
                }
            )
    return rows


def differences(reference: tuple[Any, Any], found: tuple[Any, Any]) -> tuple[int, int]:
    """Number of the reference's hits (vf, ee) that are missed, and of additional hits."""
    pairs = [(keys(a), keys(b)) for a, b in zip(reference, found, strict=True)]
    common = sum(len(np.intersect1d(a, b, assume_unique=True)) for a, b in pairs)
    return sum(len(a) for a, _ in pairs) - common, sum(len(b) for _, b in pairs) - common


def lateness(reference: FrameAnswer, found: FrameAnswer) -> Row:
    """Compare the times of the hits that both results contain.

    Returns:
        Number of hits that are later in ``found``, and the largest delay as a fraction of the step.
    """
    after = []
    for kind in ("vf", "ee"):
        a, b = (keys(getattr(one, kind)) for one in (reference, found))
        _, i, j = np.intersect1d(a, b, assume_unique=True, return_indices=True)
        toi = [getattr(one, f"{kind}_impacts").toi for one in (reference, found)]
        after.append(toi[1][j] - toi[0][i])
    late = np.concatenate(after)
    late = late[late > LATE]
    return {"late": len(late), "late_most": float(late.max(initial=0.0))}


def judge(rows: Sequence[Row]) -> list[Row]:
    """Misses among the listed collisions, and ratios of times beside their targets."""
    quick = shared.is_quick(rows)
    whole = any(row["scene"] == RECORDED for row in table_rows(rows, "frame"))
    out: list[Row] = []
    for row in table_rows(rows, "listed"):
        wrong = row["misses"] + row["false_hits"]
        if row["method"] == "ab2pf":
            what = f"{row['scene']}, {row['listed']} listed collisions: misses and false hits"
            out.append(answer(what, "0", str(wrong), wrong == 0))
    for row in table_rows(rows, "frame mean"):
        asked = MEANS.get(row["method"])
        if asked is None:
            continue
        mean = row["times_ab2pf_mean"]
        text = f"{mean:.3g} ({row['times_ab2pf_least']:.3g} to {row['times_ab2pf_most']:.3g})"
        what = f"a frame, mean of {row['scenes']} scenes: {row['method']} over ab2pf, "
        if row["volume"] == "k_dop18":
            met = timed(mean >= asked, quick) if whole else "not judged: data absent"
            out.append(answer(what + "each on its own volume", f"{asked}", text, met))
        else:
            out.append(answer(what + f"both on {row['volume']}", "-", text))
    for row in table_rows(rows, "frame peer"):
        if (row["scene"], row["peer"]) == (RECORDED, PEER[0]):
            ours = row["ab2pf_ms"]["median"]
            text = f"{row['speedup']:.3g} ({row['peer_ms']:.3g} over {ours:.3g} ms)"
            met = timed(row["speedup"] >= PEER[1], quick)
            out.append(answer(f"a frame of {RECORDED}: {PEER[0]} over ab2pf", "10", text, met))
    return out
