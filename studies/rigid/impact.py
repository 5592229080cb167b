"""Time of impact of convex bodies under linear and angular motion, beside advancement over coal.

coal has no continuous query, and FCL's conservative advancement through its Python package answers
contact at time 0 for every pair in most processes, so the peer here is the textbook one: step by
the distance over the largest speed, the distance from coal.
"""

from __future__ import annotations

import time
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from oracles.convex_impact import AxisGap, bracket
from studies.framework import time_in_turn
from studies.rigid.convex import take
from studies.rigid.mesh import scaled
from tauguard.arrays import Array
from tauguard.report import Row, rate
from tauguard.rigid import Boxes, Motion, Tetrahedra, coal_peer, time_of_impact
from tauguard.rigid.shapes import Bodies

#: Distance at which the peer's advancement stops [m]: coal's own tolerance.
STOP = 1e-6
MOST_STEPS = 500


def run(quick: bool, seed: int) -> list[Row]:
    """A row a kind of body, and as many for the peer."""
    rng = np.random.default_rng(seed)
    n = 300 if quick else 2_000
    rows: list[Row] = []
    for kind in ("boxes", "tetrahedra"):
        a, b, ma, mb = pairs(rng, kind, n)
        early, touch = bracket(a, b, ma, mb)
        rows.append(our_row(kind, a, b, ma, mb, early, touch))
        rows.append(coal_row(kind, a, b, ma, mb, early, touch))
    return rows


def pairs(rng: np.random.Generator, kind: str, n: int) -> tuple[Bodies, Bodies, Motion, Motion]:
    """Bodies about 2 m apart that move by up to 2 m and turn by less than half a turn."""

    def body() -> Bodies:
        if kind == "tetrahedra":
            return Tetrahedra(rng.uniform(-1, 1, (n, 4, 3)))
        turn = np.tile(np.eye(3), (n, 1, 1))
        return Boxes(np.zeros((n, 3)), rng.uniform(0.2, 1, (n, 3)), turn)

    def motion() -> Motion:
        pose = np.tile(np.eye(4), (n, 1, 1))
        seed = int(rng.integers(1 << 31))
        pose[:, :3, :3] = Rotation.random(n, random_state=seed).as_matrix()
        pose[:, :3, 3] = rng.uniform(-2.5, 2.5, (n, 3))
        return Motion(pose, rng.uniform(-2, 2, (n, 3)), rng.uniform(-1.8, 1.8, (n, 3)))

    return body(), body(), motion(), motion()


def judged(early: Array, touch: Array, toi: Array) -> Row:
    """Errors of found times (inf: none) against the bracket; rows it cannot tell are set aside."""
    known = np.isfinite(touch) == np.isfinite(early)
    truth, found = known & np.isfinite(touch), np.isfinite(toi)
    later = truth & found & (touch > 0)
    # The bracket is 1.5e-11 wide; the error is against its far end, so it is not flattered.
    error = np.abs(touch[later] - toi[later])
    return {
        "hits": int(truth.sum()),
        "undecided": int((~known).sum()),
        "missed": rate(int((truth & ~found).sum()), int(truth.sum())),
        "false": rate(int((known & ~truth & found).sum()), int((known & ~truth).sum())),
        "late": rate(int((truth & found & (toi > touch)).sum()), int(truth.sum())),
        "toi_error_median": float(np.median(error)) if later.any() else None,
        "toi_error_max": float(error.max()) if later.any() else None,
    }


def groups(early: Array, touch: Array) -> dict[str, NDArray[np.intp]]:
    """Rows that first touch within the step, and rows that stay apart."""
    later = np.isfinite(touch) & (touch > 0)
    return {"hit": np.flatnonzero(later), "miss": np.flatnonzero(np.isinf(early))}


def our_row(
    kind: str, a: Bodies, b: Bodies, ma: Motion, mb: Motion, early: Array, touch: Array
) -> Row:
    """Time per pair and errors of ``time_of_impact``."""
    toi = time_of_impact(a, b, ma, mb).time_of_impact
    calls, count = {}, {}
    for name, index in groups(early, touch).items():
        part = take(a, index), take(b, index), take(ma, index), take(mb, index)
        calls[name], count[name] = partial(time_of_impact, *part), len(index)
    us = {
        name: scaled(t, 1e6 / count[name])
        for name, t in time_in_turn(calls, clock=time.process_time).items()
    }
    return {
        "study": "time of impact",
        "method": "tauguard",
        "bodies": kind,
        "pairs": len(a),
        "us_hit": us["hit"],
        "us_miss": us["miss"],
        "us_call": None,
        "steps_hit": None,
        **judged(early, touch, toi),
    }


def coal_row(
    kind: str, a: Bodies, b: Bodies, ma: Motion, mb: Motion, early: Array, touch: Array
) -> Row:
    """Conservative advancement (Mirtich 1996) over coal's distance, stopped at ``STOP``.

    Only the distance calls are timed, net of a call's overhead: what a native loop would cost
    without its poses and its bound.
    """
    base: Row = {"study": "time of impact", "method": "advancement over coal's distance"}
    try:
        coal = coal_peer.coal_module()
    except ValueError:
        return {**base, "bodies": kind, "note": "coal is not installed"}
    toi, seconds, steps = advanced(coal, a, b, ma, mb)
    call = call_seconds(coal)
    net = 1e6 * np.maximum(seconds - steps * call, 0.0)
    us = {name: float(net[index].mean()) for name, index in groups(early, touch).items()}
    return {
        **base,
        "bodies": kind,
        "pairs": len(a),
        "us_hit": us["hit"],
        "us_miss": us["miss"],
        "us_call": 1e6 * call,
        "steps_hit": float(steps[groups(early, touch)["hit"]].mean()),
        **judged(early, touch, toi),
    }


def advanced(
    coal: Any, a: Bodies, b: Bodies, ma: Motion, mb: Motion
) -> tuple[Array, Array, NDArray[np.intp]]:
    """Times of contact (inf: none), seconds in coal's distance, and its calls, pair by pair."""
    shapes = [[geometry for geometry, _ in coal_peer.geometries(body)] for body in (a, b)]
    speed = AxisGap(a, b, ma, mb).speed
    n = len(a)
    t, toi, seconds = np.zeros(n), np.full(n, np.inf), np.zeros(n)
    steps = np.zeros(n, dtype=np.intp)
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    alive = np.arange(n)
    for _ in range(MOST_STEPS):
        places = [take(m, alive).at(t[alive]) for m in (ma, mb)]
        for k, i in enumerate(alive):
            left, right = (coal.Transform3s(p[k, :3, :3], p[k, :3, 3]) for p in places)
            result.clear()
            start = time.perf_counter()
            gap = coal.distance(shapes[0][i], left, shapes[1][i], right, request, result)
            seconds[i] += time.perf_counter() - start
            if gap <= STOP:
                toi[i], t[i] = t[i], np.inf
            t[i] += max(gap, 0.0) / speed[i]
        steps[alive] += 1
        alive = alive[t[alive] < 1]
        if len(alive) == 0:
            break
    toi[alive] = t[alive]  # still creeping towards contact: as far as it got
    return toi, seconds, steps


def call_seconds(coal: Any) -> float:
    """What a distance call costs when there is nothing to do: two spheres."""
    sphere, here = coal.Sphere(0.1), coal.Transform3s.Identity()
    far = coal.Transform3s(np.eye(3), np.array([9.0, 0, 0]))
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    seconds = []
    for _ in range(1000):
        result.clear()
        start = time.perf_counter()
        coal.distance(sphere, here, sphere, far, request, result)
        seconds.append(time.perf_counter() - start)
    return float(np.median(seconds))


def draw(rows: list[Row], axes: Any) -> None:
    """Largest error over time per hit."""
    for row in (row for row in rows if row["study"] == "time of impact" and "us_hit" in row):
        us = row["us_hit"]["median"] if isinstance(row["us_hit"], dict) else row["us_hit"]
        mark = "o" if row["bodies"] == "boxes" else "^"
        who = "tauguard" if row["method"] == "tauguard" else "over coal"
        axes.loglog(us, row["toi_error_max"], mark, ms=8, label=f"{who}, {row['bodies']}")
    axes.axhline(1e-7, color="grey", lw=0.8)
    axes.axvline(20, color="grey", lw=0.8)
    axes.set(xlim=(1, 1000), ylim=(1e-13, 1), xlabel="us a hit", ylabel="largest error of the time")
    axes.set_title("time of impact, turning bodies", fontsize="medium")
    axes.legend(fontsize="x-small", loc="lower right")
