"""coal as the peer: overlap without the overhead of calls; advancement by coal's distance."""

import time
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from oracles import coal_peer
from oracles.coal_motion import CONTACT, MovingDistance, advanced_times
from studies.framework import per, time_in_turn
from tauguard.arrays import Array
from tauguard.report import Row
from tauguard.rigid import Impacts
from tauguard.rigid.shapes import Bodies


def overlap(a: Bodies, b: Bodies) -> tuple[NDArray[np.bool_], dict[str, float], float]:
    """coal's answers, time per pair [ns], and median time without loop and call [ns].

    Loop and call are timed on two spheres far apart, the fastest query there is.
    """
    coal, n = coal_peer.coal_module(), len(a)
    left, right = coal_peer.geometries(a), coal_peer.geometries(b)
    sphere, far = coal.Sphere(0.1), coal.Transform3s(np.eye(3), np.array([9.0, 0, 0]))
    apart = [(sphere, coal.Transform3s.Identity())] * n, [(sphere, far)] * n
    found = [coal_peer.collide_all(left, right) for _ in range(3)]
    overhead = np.median([coal_peer.collide_all(*apart)[1] for _ in range(3)])
    seconds = [one[1] for one in found]
    query = {"median": float(np.median(seconds)), "low": min(seconds), "high": max(seconds)}
    net = float(query["median"] - overhead) / n * 1e9
    return np.array(found[0][0]), per(query, n), net


def outcomes(toi: Array) -> dict[str, NDArray[np.intp]]:
    """The rows that touch after the start of the step, and the rows that stay apart."""
    return {
        "hit": np.flatnonzero(np.isfinite(toi) & (toi > 0)),
        "miss": np.flatnonzero(np.isinf(toi)),
    }


def times(
    call: Callable[[NDArray[np.intp]], Impacts], toi: Array, least: int = 1
) -> dict[str, dict[str, float] | None]:
    """Processor time of a pair that touches and of one that does not [us].

    Fewer pairs than ``least`` are repeated within one call, so that the overhead of a call does not
    dominate their time.
    """
    found = {name: index for name, index in outcomes(toi).items() if len(index)}
    chosen = {name: np.resize(index, max(len(index), least)) for name, index in found.items()}
    calls = {name: partial(call, index) for name, index in chosen.items()}
    spent = time_in_turn(calls, 3, time.process_time)
    us = {f"us_{name}": per(spent[name], len(index), 1e6) for name, index in chosen.items()}
    return {"us_hit": us.get("us_hit"), "us_miss": us.get("us_miss")}


def motion_columns(
    call: Callable[[NDArray[np.intp]], Impacts],
    distance: MovingDistance,
    lever: Array | float,
    most: int | None = None,
    least: int = 1,
) -> Row:
    """Check times of impact by coal's distance at the time found and at moments before.

    Args:
        call: function that gives our times of impact of the chosen rows.
        distance: coal's distance function of the same pairs.
        lever: sum of both bodies' largest distances from the origins of their frames [m].
        most: advance only this many pairs of each outcome (default: all).
        least: least number of pairs in a timed call.
    """
    every = np.arange(distance.n)
    found = call(every)
    end = np.where(found.hit, found.time_of_impact, 1.0)
    hits = outcomes(found.time_of_impact)["hit"]
    path = np.min([distance(every, share * end) for share in np.linspace(0, 0.999, 24)], axis=0)
    early = path < -CONTACT if distance.signed else path <= 0
    a, b = distance.motions
    turn = np.maximum(*(np.linalg.norm(m.angular, axis=1) for m in (a, b)))
    speed = np.broadcast_to(np.linalg.norm(a.linear - b.linear, axis=1) + lever * turn, every.shape)
    at_toi = np.abs(distance(hits, found.time_of_impact[hits])).max(initial=0.0)
    asked = (
        every
        if most is None
        else np.concatenate([hits[:most], outcomes(found.time_of_impact)["miss"]])
    )
    asked = np.sort(asked[: most and 2 * most])
    toi = advanced_times(distance, asked, speed)
    both = asked[np.isfinite(toi[asked]) & found.hit[asked] & (found.time_of_impact[asked] > 0)]
    return {
        "pairs": distance.n,
        "hits": int(found.hit.sum()),
        **times(call, found.time_of_impact, least),
        "coal_us": 1e6 * float(distance.seconds[asked].mean()),
        "coal_calls": float(distance.calls[asked].mean()),
        "met_before": int((early & (found.time_of_impact > 0)).sum()),
        "distance_at_toi": float(at_toi),
        "coal_disagrees": int((np.isfinite(toi[asked]) != found.hit[asked]).sum()),
        "toi_differs_most": float(np.abs(toi[both] - found.time_of_impact[both]).max(initial=0.0)),
    }
