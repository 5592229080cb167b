"""The broad phase: kinds of bounding volumes, and growth of cost up to 10^6 triangles."""

from collections.abc import Sequence
from functools import partial
from time import process_time

import numpy as np

from studies.cloth.shared import CLOTHS, run_row, step_at
from studies.framework import answer, per, table_rows, time_in_turn
from tauguard.cloth import VOLUMES, MeshCCD
from tauguard.cloth.scenes import SCENES, Scene
from tauguard.report import Row

#: The kinds of volume; the "aabb" names repeat k = 6.
KINDS = [name for name in VOLUMES if "aabb" not in name]
#: The default of ``MeshCCD``.
DEFAULT = "auto"
#: For at least this many triangles a time is the median of at most three repeats.
LARGE = 300_000

NOTES = {
    "volume": "time of a frame and candidates of the narrow phase by kind of bounding volume.",
    "size": "one frame of growing meshes, whose motion stays in proportion to their edges. "
    "exponent: slope of log frame_ms over log triangles, by scene.",
}


def measure(quick: bool, seed: int) -> list[Row]:
    """Measure all volumes at one size, then the default volume at growing sizes."""
    triangles, repeats = (4_000, 3) if quick else (40_000, 7)
    sizes = [1_000, 10_000] if quick else [1_000, 10_000, 100_000, 1_000_000]
    rows = [run_row(quick, triangles=triangles, repeats=repeats)]
    for name in CLOTHS:
        found = _rows(SCENES[name](triangles, seed), 0.85, KINDS, repeats)
        rows += [{"study": "volume", **row} for row in found]
    for name in CLOTHS:
        few = [repeats if n < LARGE else min(repeats, 3) for n in sizes]
        scenes = (SCENES[name](n, seed) for n in sizes)
        found = [_rows(s, 0.7, [DEFAULT], k)[0] for s, k in zip(scenes, few, strict=True)]
        n, ms = ([r["triangles"] for r in found], [r["frame_ms"]["median"] for r in found])
        slope = float(np.polyfit(np.log(n), np.log(ms), 1)[0])
        rows += [{"study": "size", **row, "exponent": None} for row in found]
        rows[-1]["exponent"] = slope
    return rows


def _rows(scene: Scene, moment: float, kinds: Sequence[str], repeats: int) -> list[Row]:
    """A row for each kind of volume, on the scene's frame at ``moment``."""
    step = step_at(scene, moment)
    meshes = {kind: MeshCCD(scene.faces, groups=scene.groups, volume=kind) for kind in kinds}
    calls = {kind: partial(ccd.find, *step) for kind, ccd in meshes.items()}
    times = time_in_turn(calls, repeats, process_time)
    found = {kind: ccd.find(*step).stats for kind, ccd in meshes.items()}
    return [
        {
            "scene": scene.name,
            "triangles": len(scene.faces),
            "volume": kind,
            "frame_ms": per(times[kind], 1, 1e3),
            "vf_candidates": stats.vf["candidates"],
            "ee_candidates": stats.ee["candidates"],
            "bytes_per_triangle": stats.bytes / len(scene.faces),
        }
        for kind, stats in found.items()
    ]


def judge(rows: Sequence[Row]) -> list[Row]:
    """Exponents of growth, and memory per triangle."""
    sizes = table_rows(rows, "size")
    slopes = [row["exponent"] for row in sizes if row["exponent"] is not None]
    low, high = (end(row["triangles"] for row in sizes) for end in (min, max))
    what = f"a frame's time, {low} to {high} triangles: exponent"
    most = max(row["bytes_per_triangle"] for row in sizes)
    return [
        answer(what, "-", f"{min(slopes):.2f} to {max(slopes):.2f}"),
        answer("bytes for each triangle, most", "-", f"{most:.0f}"),
    ]
