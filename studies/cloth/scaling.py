"""What the broad phase of a deforming mesh is made of: volumes, front, size, threads, topology.

Every function returns flat rows whose ``study`` names what is varied.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studies.framework import time_in_turn
from tauguard.cloth import VOLUMES, Groups, MeshCCD
from tauguard.cloth.scenes import SCENES, Scene
from tauguard.report import Row

Step = tuple[NDArray[np.float64], NDArray[np.float64]]

#: The scenes of these tables; frames are timed on all.
CLOTHS = ("pleats", "turning_ball", "seated_skirt", "twisting_mats", "crumpling")
#: The kinds of volume; the "aabb" names repeat k = 6.
KINDS = [name for name in VOLUMES if "aabb" not in name]


def scenes(triangles: int, seed: int) -> Iterator[Scene]:
    """The generated cloths at one size."""
    for name in CLOTHS:
        yield SCENES[name](triangles, seed)


def step_at(scene: Scene, moment: float) -> Step:
    """Both ends of the scene's step that starts at about ``moment`` in [0, 1)."""
    first = min(round(moment * scene.frames), scene.frames - 1)
    return scene.positions(first / scene.frames), scene.positions((first + 1) / scene.frames)


def volumes(triangles: int, seed: int, repeats: int) -> list[Row]:
    """Each kind of volume on each scene: what it costs and what it leaves to the narrow phase."""
    rows: list[Row] = []
    for scene in scenes(triangles, seed):
        step = step_at(scene, 0.85)
        meshes = {kind: MeshCCD(scene.faces, groups=scene.groups, volume=kind) for kind in KINDS}
        times = time_in_turn(
            {kind: bound(ccd.find, *step) for kind, ccd in meshes.items()}, repeats, process_time
        )
        for kind, ccd in meshes.items():
            stats = ccd.find(*step).stats
            rows.append(
                {
                    "study": "volume",
                    "scene": scene.name,
                    "triangles": len(scene.faces),
                    "volume": kind,
                    "frame_ms": scaled(times[kind], 1e3),
                    "vf_candidates": stats.vf["candidates"],
                    "ee_candidates": stats.ee["candidates"],
                    "bytes_per_triangle": stats.bytes / len(scene.faces),
                }
            )
    return rows


def front(triangles: int, seed: int, frames: int) -> list[Row]:
    """Coherent frames with the front kept, against a descent from the root in every frame."""
    rows: list[Row] = []
    for scene in scenes(triangles, seed):
        kept = MeshCCD(scene.faces, groups=scene.groups)
        fresh = MeshCCD(scene.faces, groups=scene.groups)
        tests, seconds, total = np.zeros(2), np.zeros(2), np.zeros(2)
        first = round(0.6 * scene.frames)
        kept.find(*step_at(scene, first / scene.frames))
        count = min(frames, scene.frames - first - 1)
        for i in range(1, count + 1):
            step = step_at(scene, (first + i) / scene.frames)
            for j, stats in enumerate(
                (kept.find(*step).stats, fresh.find(*step, fresh=True).stats)
            ):
                tests[j] += stats.vf["node_tests"] + stats.ee["node_tests"]
                seconds[j] += stats.seconds["traverse"]
                total[j] += stats.seconds["total"]
        rows.append(
            {
                "study": "front",
                "scene": scene.name,
                "frames": count,
                "node_tests_kept": round(tests[0] / count),
                "node_tests_fresh": round(tests[1] / count),
                "node_tests_saved": float(1 - tests[0] / tests[1]),
                "descent_ms_kept": 1e3 * seconds[0] / count,
                "descent_ms_fresh": 1e3 * seconds[1] / count,
                "descent_saved": 1 - seconds[0] / seconds[1],
                "frame_saved": 1 - (total[1] - seconds[1] + seconds[0]) / total[1],
            }
        )
    return rows


def size(sizes: list[int], seed: int, repeats: int) -> list[Row]:
    """One frame of growing meshes whose motion keeps in proportion to their edges; the exponent.

    The exponent is the slope of the logarithm of the median time over that of the triangles.
    """
    rows: list[Row] = []
    for name in CLOTHS:
        points: list[tuple[float, float]] = []
        for triangles in sizes:
            scene = SCENES[name](triangles, seed)
            step = step_at(scene, 0.7)
            ccd = MeshCCD(scene.faces, groups=scene.groups)
            few = repeats if triangles < 300_000 else min(repeats, 3)
            spent = time_in_turn({"frame": bound(ccd.find, *step)}, few, process_time)["frame"]
            stats = ccd.find(*step).stats
            points.append((len(scene.faces), spent["median"]))
            candidates = stats.vf["candidates"] + stats.ee["candidates"]
            rows.append(
                {
                    "study": "size",
                    "scene": name,
                    "triangles": len(scene.faces),
                    "frame_ms": scaled(spent, 1e3),
                    "microseconds_per_triangle": 1e6 * spent["median"] / len(scene.faces),
                    "candidates_per_triangle": candidates / len(scene.faces),
                    "bytes_per_triangle": stats.bytes / len(scene.faces),
                    "exponent": None,
                }
            )
        n, t = np.log(np.array(points)).T
        rows[-1]["exponent"] = float(np.polyfit(n, t, 1)[0])
    return rows


def threads(triangles: int, seed: int, repeats: int) -> list[Row]:
    """One thread against two on the same frame, and whether the answers have the same bits."""
    rows: list[Row] = []
    for scene in scenes(triangles, seed):
        step = step_at(scene, 0.85)
        meshes = {n: MeshCCD(scene.faces, groups=scene.groups, threads=n) for n in (1, 2)}
        spent = time_in_turn({str(n): bound(ccd.find, *step) for n, ccd in meshes.items()}, repeats)
        one, two = (ccd.find(*step) for ccd in meshes.values())
        rows.append(
            {
                "study": "threads",
                "scene": scene.name,
                "triangles": len(scene.faces),
                "one_thread_ms": scaled(spent["1"], 1e3),
                "two_threads_ms": scaled(spent["2"], 1e3),
                "speedup": spent["1"]["median"] / spent["2"]["median"],
                "same_bits": bool(
                    one.vf.tobytes() == two.vf.tobytes()
                    and one.ee.tobytes() == two.ee.tobytes()
                    and one.vf_impacts.toi.tobytes() == two.vf_impacts.toi.tobytes()
                    and one.ee_impacts.toi.tobytes() == two.ee_impacts.toi.tobytes()
                ),
            }
        )
    return rows


def topology(triangles: int, seed: int, repeats: int) -> list[Row]:
    """A share of the faces goes and comes back: the update against a new mesh of those faces.

    Both times hold the frame after the change, which is where a new mesh builds its hierarchy.
    """
    rows: list[Row] = []
    for scene in scenes(triangles, seed):
        step = step_at(scene, 0.7)
        for share in (0.0001, 0.001, 0.01, 0.1):
            rng = np.random.default_rng(seed)
            gone = rng.choice(len(scene.faces), max(1, round(share * len(scene.faces))), False)
            cut = np.delete(scene.faces, gone, axis=0)
            ccd = MeshCCD(scene.faces, groups=scene.groups)
            ccd.find(*step)
            calls = {
                "update": bound(_change_and_find, ccd, [scene.faces, cut], step),
                "rebuild": bound(_build_and_find, cut, scene.groups, step),
                "frame": bound(ccd.find, *step),
            }
            spent = time_in_turn(calls, repeats)
            rows.append(
                {
                    "study": "topology",
                    "scene": scene.name,
                    "triangles": len(scene.faces),
                    "changed_faces": len(gone),
                    "update_ms": scaled(spent["update"], 1e3),
                    "rebuild_ms": scaled(spent["rebuild"], 1e3),
                    "frame_ms": scaled(spent["frame"], 1e3),
                    "speedup": spent["rebuild"]["median"] / spent["update"]["median"],
                }
            )
    return rows


def _change_and_find(ccd: MeshCCD, lists: list[NDArray[np.int32]], step: Step) -> None:
    lists.reverse()  # cut, whole, cut, ...
    ccd.update_topology(lists[0])
    ccd.find(*step)


def _build_and_find(faces: NDArray[np.int32], groups: Groups | None, step: Step) -> None:
    MeshCCD(faces, groups=groups).find(*step)


def bound(function: Callable[..., Any], *arguments: Any) -> Callable[[], Any]:
    """A call without arguments."""
    return lambda: function(*arguments)


def scaled(spread: dict[str, float], factor: float) -> dict[str, float]:
    """Median, low and high in another unit."""
    return {key: factor * value for key, value in spread.items()}
