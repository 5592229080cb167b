"""Whole frames: every method beside ipctk's broad and narrow phases, hits and misses with it.

Everything here runs in one thread, and times are the processor's: other programs do not count.
"""

from __future__ import annotations

from pathlib import Path
from time import process_time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from studies.cloth.peer import load_ipctk
from studies.cloth.scaling import CLOTHS, Step, bound, scaled, step_at
from studies.framework import time_in_turn
from tauguard.cloth import Frame as FrameAnswer
from tauguard.cloth import Groups
from tauguard.cloth.comparators import ComparedMeshCCD as MeshCCD
from tauguard.cloth.scenes import SCENES, load_sequence
from tauguard.report import Row

#: Method and volume: what each was published with, then all on the same candidates.
ENTRIES = [
    ("ab2pf", "moving_k_dop14"),
    ("iccd", "k_dop18"),
    ("dnf", "k_dop18"),
    ("scd", "k_dop18"),
    ("vcd", "k_dop18"),
    ("naive", "k_dop18"),
    ("ab2pf", "k_dop18"),
    ("iccd", "moving_k_dop14"),
    ("vcd", "moving_k_dop14"),
]


class Frame(NamedTuple):
    """One step of a mesh to be timed."""

    name: str
    faces: NDArray[np.int32]
    groups: Groups | None
    step: Step


def frames(triangles: int, seed: int, data: Path | None) -> list[Frame]:
    """A late step of every generated scene, and the real cloth-ball step where the data is."""
    built = [build(triangles, seed) for build in SCENES.values()]
    found = [Frame(s.name, s.faces, s.groups, step_at(s, 0.85)) for s in built]
    folder = None if data is None else data / "ccd" / "cloth-ball" / "frames"
    if folder is not None and folder.is_dir():
        sequence = load_sequence(folder)
        found.append(Frame("cloth-ball", sequence.faces, None, next(sequence.steps())))
    return found


def methods(frame: Frame, repeats: int) -> list[Row]:
    """Every method on one frame, with what it misses and adds against ab2pf.

    ab2pf misses nothing; on cloth-ball its hits are exactly the listed ones, on the generated
    scenes they are an upper bound, so that "missed" there may hold a false hit of ab2pf's.
    """
    truth = MeshCCD(frame.faces, groups=frame.groups).find(*frame.step)
    meshes = {
        (method, volume): MeshCCD(frame.faces, method, groups=frame.groups, volume=volume)
        for method, volume in ENTRIES
    }
    spent = time_in_turn(
        {" ".join(key): bound(ccd.find, *frame.step) for key, ccd in meshes.items()},
        repeats,
        process_time,
    )
    ours = spent[" ".join(ENTRIES[0])]["median"]
    rows: list[Row] = []
    for (method, volume), ccd in meshes.items():
        answer = ccd.find(*frame.step)
        vf, ee = compare(truth.vf, answer.vf), compare(truth.ee, answer.ee)
        time_ms = scaled(spent[f"{method} {volume}"], 1e3)
        rows.append(
            {
                "study": "frame",
                "scene": frame.name,
                "triangles": len(frame.faces),
                "method": method,
                "volume": volume,
                "frame_ms": time_ms,
                "times_ab2pf": time_ms["median"] / (1e3 * ours),
                "candidates": answer.stats.vf["candidates"] + answer.stats.ee["candidates"],
                "ab2pf_hits": len(truth.vf) + len(truth.ee),
                "missed": vf[0] + ee[0],
                "added": vf[1] + ee[1],
                **lateness(truth, answer),
            }
        )
    return rows


def means(rows: list[Row]) -> list[Row]:
    """How many times the first entry's time each method takes: over the cloths, then over all."""
    frames = [row for row in rows if row["study"] == "frame"]
    cloths = [row for row in frames if row["scene"] in (*CLOTHS, "cloth-ball")]
    return [
        _mean(study, of, entry)
        for study, of in (("frame mean", cloths), ("frame mean of all", frames))
        for entry in ENTRIES
    ]


def _mean(study: str, rows: list[Row], entry: tuple[str, str]) -> Row:
    own = [row for row in rows if (row["method"], row["volume"]) == entry]
    ratios = [row["times_ab2pf"] for row in own]
    return {
        "study": study,
        "method": entry[0],
        "volume": entry[1],
        "scenes": len(own),
        "times_ab2pf_mean": float(np.mean(ratios)),
        "times_ab2pf_least": min(ratios),
        "times_ab2pf_most": max(ratios),
        "missed": sum(row["missed"] for row in own),
        "late": sum(row["late"] for row in own),
    }


def peers(frame: Frame, repeats: int, limit: int, tight_limit: int) -> list[Row]:
    """ipctk's LBVH and narrow phases on the same frame and one thread, all collisions.

    The narrow phase is timed in its own C++ loop over up to ``limit`` candidates drawn from those
    that the truth calls clear (a hit would shorten the step for what follows), and its time per
    query is taken times the number of candidates; hits cost it more than that. Both sides test
    everything against everything (no groups), so that they have the same work.
    """
    ipctk = load_ipctk()
    if ipctk is None:
        return [{"study": "frame peer", "scene": frame.name, "peer": "ipctk is not installed"}]
    ccd = MeshCCD(frame.faces)
    answer = ccd.find(*frame.step)
    x_t0, x_t1 = (np.asfortranarray(x) for x in frame.step)
    mesh = ipctk.CollisionMesh(x_t0, ccd.edges, frame.faces)
    found = ipctk.Candidates()
    spent = time_in_turn(
        {
            "ours": bound(ccd.find, *frame.step),
            "LBVH": lambda: found.build(mesh, x_t0, x_t1, 0.0, ipctk.LBVH()),
        },
        repeats,
        process_time,
    )
    lists = found.fv_candidates, found.ee_candidates  # each call makes a list of millions
    n_vf, n_ee = map(len, lists)
    rows: list[Row] = []
    narrow = {
        "AdditiveCCD": (ipctk.AdditiveCCD(), limit),
        "TightInclusionCCD": (ipctk.TightInclusionCCD(conservative_rescaling=1.0), tight_limit),
    }
    for name, (method, most) in narrow.items():
        seconds = {}
        for kind, clear in _clear(*lists, answer, most).items():
            part = ipctk.Candidates()
            setattr(part, f"{kind}_candidates", clear)
            start = process_time()
            part.compute_collision_free_stepsize(mesh, x_t0, x_t1, 0.0, method)
            seconds[kind] = (process_time() - start) / max(1, len(clear))
        total = spent["LBVH"]["median"] + n_vf * seconds["fv"] + n_ee * seconds["ee"]
        rows.append(
            {
                "study": "frame peer",
                "scene": frame.name,
                "peer": f"ipctk LBVH + {name}",
                "peer_candidates": n_vf + n_ee,
                "broad_ms": scaled(spent["LBVH"], 1e3),
                "vf_ns": 1e9 * seconds["fv"],
                "ee_ns": 1e9 * seconds["ee"],
                "peer_ms": 1e3 * total,
                "ab2pf_ms": scaled(spent["ours"], 1e3),
                "speedup": total / spent["ours"]["median"],
            }
        )
    return rows


def _clear(fv: list[Any], ee: list[Any], answer: Any, most: int) -> dict[str, list[Any]]:
    """Up to ``most`` candidates of each kind, evenly over the list, without the true hits."""
    hits = {tuple(pair) for pair in answer.vf.tolist()}
    clear_fv = [c for c in fv[:: 1 + len(fv) // most] if (c.vertex_id, c.face_id) not in hits]
    hits = {tuple(pair) for pair in answer.ee.tolist()}
    clear_ee = [
        c
        for c in ee[:: 1 + len(ee) // most]
        if (min(c.edge0_id, c.edge1_id), max(c.edge0_id, c.edge1_id)) not in hits
    ]
    return {"fv": clear_fv, "ee": clear_ee}


def lateness(truth: FrameAnswer, found: FrameAnswer) -> Row:
    """How many of the common hits' times are late, and the latest by how much of the step.

    The truth's times are at most 1e-9 of the step early, so less than that is no lateness.

    Args:
        truth: A frame with times that are never late.
        found: Another method's frame of the same step; the pairs of both are compared.

    Returns:
        ``late``, a count, and ``late_most``, a share of the step (0 where none is late).
    """
    after = np.concatenate(
        [
            _after(truth.vf, truth.vf_impacts.toi, found.vf, found.vf_impacts.toi),
            _after(truth.ee, truth.ee_impacts.toi, found.ee, found.ee_impacts.toi),
        ]
    )
    late = after[after > 1e-9]
    return {"late": len(late), "late_most": float(late.max(initial=0.0))}


def _after(
    pairs: NDArray[np.int32],
    toi: NDArray[np.float64],
    other: NDArray[np.int32],
    other_toi: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The other's times less the first's, of the pairs that both have."""
    weights = np.array([1 << 32, 1])
    a, b = (x.astype(np.int64) @ weights for x in (pairs, other))
    _, i, j = np.intersect1d(a, b, assume_unique=True, return_indices=True)
    return other_toi[j] - toi[i]


def compare(truth: NDArray[np.int32], found: NDArray[np.int32]) -> tuple[int, int]:
    """Misses and false hits of sorted pairs."""
    weights = np.array([1 << 32, 1])
    a, b = truth.astype(np.int64) @ weights, found.astype(np.int64) @ weights
    common = len(np.intersect1d(a, b, assume_unique=True))
    return len(truth) - common, len(found) - common
