"""The report's first answer: how fast, how wrong, beside whom; one line a question."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

from studies.gaps import Gaps
from studies.panels import Studies, number, rows_of
from tauguard.report import Row, cell

#: Units of time and how many microseconds each is.
UNITS = (("s", 1e6), ("ms", 1e3), ("µs", 1.0), ("ns", 1e-3))
#: The lowest peak torque [N m] of the collisions that every detector is judged by.
FROM = "from 16 N m up"


def time_text(us: float) -> str:
    """A time with its unit, three digits."""
    unit, size = next(((u, s) for u, s in UNITS if us >= s), UNITS[-1])
    return f"{us / size:.3g} {unit}"


def kernels(studies: Studies, gaps: Gaps) -> list[Row]:
    """Time and error of each kernel, its peer's of the same run, and the ratio of both times."""
    sources = {
        "cloth, queries": _queries,
        "cloth, frames": _frames,
        "rigid, convex bodies": _convex,
        "rigid, time of impact": _impacts,
        "rigid, meshes": _meshes,
        "environments, steps": _steps,
        "detection_online": _online,
    }
    return _lines(sources, studies, gaps)


def _lines(
    sources: Mapping[str, Callable[[Studies], Iterator[Row]]], studies: Studies, gaps: Gaps
) -> list[Row]:
    """The lines of all sources; one whose rows are not as expected is a gap."""
    no_rows: list[Row] = []
    made = [
        gaps.attempt(f"first tables, {name}", partial(_all, source, studies), no_rows)
        for name, source in sources.items()
    ]
    return [row for rows in made for row in rows]


def _all(source: Callable[[Studies], Iterator[Row]], studies: Studies) -> list[Row]:
    return list(source(studies))


def _only(rows: Sequence[Row], **wanted: object) -> Row:
    """The first row with these values.

    Raises:
        ValueError: there is none.
    """
    for row in rows:
        if all(row.get(key) == value for key, value in wanted.items()):
            return row
    asked = ", ".join(f"{key} {value}" for key, value in wanted.items())
    raise ValueError(f"no row with {asked}")


def _line(asked: str, ours: tuple[float, str], peer: str, its: tuple[float, str]) -> Row:
    return {
        "what": asked,
        "tauguard takes": time_text(ours[0]),
        "tauguard's error": ours[1],
        "peer": peer,
        "peer takes": time_text(its[0]),
        "peer's error": its[1],
        "peer / tauguard": f"{its[0] / ours[0]:.3g}",
    }


def _count(rates: Sequence[Any]) -> tuple[int, int]:
    """How many of how many, over several rates."""
    known = [rate for rate in rates if isinstance(rate, Mapping) and rate["n"]]
    return round(sum(r["value"] * r["n"] for r in known)), sum(r["n"] for r in known)


def _wrong(name: str, rates: Sequence[Any]) -> str:
    wrong, of = _count(rates)
    return f"{wrong:,} {name} of {of:,}"


def _queries(studies: Studies) -> Iterator[Row]:
    """Single queries of a recorded cloth, hits included."""
    peers = rows_of(studies, "cloth", "query peer")
    own = [row for row in rows_of(studies, "cloth", "query") if row["method"] == "ab2pf"]
    error = f"{_errors(own)}; time within {max((r['toi_error_most'] for r in own), default=0):.0e}"
    for name in dict.fromkeys(row["peer"] for row in peers):
        mine = [row for row in peers if row["peer"] == name]
        both = next((row for row in mine if row["kind"] == "both"), None)
        if both is not None:
            rated = [row for row in mine if row["kind"] != "both"]
            early = max(row["toi_error_median"] for row in rated)
            text = f"{_errors(rated)}; time early by {early:.0e} (median)"
            ours, its = 1e-3 * both["ab2pf_all_ns"], 1e-3 * both["all_ns"]
            yield _line("a vertex-face or edge-edge query", (ours, error), name, (its, text))


def _errors(rows: Sequence[Row]) -> str:
    missed, false = _count([r["misses"] for r in rows]), _count([r["false_hits"] for r in rows])
    return f"{missed[0]:,} missed of {missed[1]:,}, {false[0]:,} false of {false[1]:,}"


def _frames(studies: Studies) -> Iterator[Row]:
    """The largest frame of a deforming mesh."""
    peers = rows_of(studies, "cloth", "frame peer")
    if not peers:
        return
    largest = max(peers, key=lambda row: number(row["ab2pf_ms"]) or 0.0)["scene"]
    own = _only(rows_of(studies, "cloth", "frame"), method="ab2pf", scene=largest)
    error = f"{own['missed']} missed, {own['late']} late of {own['ab2pf_hits']:,}"
    for row in peers:
        if row["scene"] == largest:
            ours = 1e3 * (number(row["ab2pf_ms"]) or 0.0)
            what = f"a frame of {largest}, {own['triangles']:,} triangles"
            yield _line(
                what, (ours, error), row["peer"], (1e3 * row["peer_ms"], "not judged on frames")
            )


def _convex(studies: Studies) -> Iterator[Row]:
    rows = rows_of(studies, "rigid", "table 2.1 static")
    rows = [row for row in rows if row.get("coal_net_ns") is not None]
    if rows:
        ours = sum(number(row["auto_ns"]) or 0.0 for row in rows) / len(rows)
        its = sum(row["coal_net_ns"] for row in rows) / len(rows)
        mine = _wrong("wrong", [row.get("auto_wrong") for row in rows])
        theirs = _wrong("wrong", [row.get("coal_wrong") for row in rows])
        what = "overlap of two convex bodies"
        yield _line(what, (1e-3 * ours, mine), "coal, net of its call", (1e-3 * its, theirs))


def _impacts(studies: Studies) -> Iterator[Row]:
    rows = rows_of(studies, "rigid", "time of impact")
    for bodies in dict.fromkeys(row["bodies"] for row in rows):
        both = [row for row in rows if row["bodies"] == bodies]
        ours = next((row for row in both if row["method"] == "tauguard"), None)
        peer = next((row for row in both if row["method"] != "tauguard"), None)
        if ours and peer:
            parts = [(number(r["us_hit"]) or 0.0, _impact_error(r)) for r in (ours, peer)]
            what = f"time of impact of two turning {bodies}"
            yield _line(what, parts[0], str(peer["method"]), parts[1])


def _impact_error(row: Row) -> str:
    missed, of = _count([row["missed"]])
    return f"{missed} missed of {of:,}; time within {row['toi_error_max']:.0e}"


def _meshes(studies: Studies) -> Iterator[Row]:
    rows = [r for r in rows_of(studies, "rigid", "table 2.2 static") if r.get("volume") == "obb"]
    rows = [row for row in rows if row.get("coal_mean_us") is not None]
    if rows:
        poses = sum(row["poses"] for row in rows)
        ours = sum((number(r["batch_mean_us"]) or 0.0) * r["poses"] for r in rows) / poses
        its = sum(row["coal_mean_us"] * row["poses"] for row in rows) / poses
        disagree = _wrong("answers differ", [rows[0]["disagree"]])
        yield _line("overlap of two meshes", (ours, disagree), "coal, OBBRSS", (its, disagree))


def _steps(studies: Studies) -> Iterator[Row]:
    rows = rows_of(studies, "environments", "step")
    if rows:
        peers = [row for row in rows if str(row["what"]).startswith("mujoco.rollout")]
        if not peers:
            raise ValueError("no row of mujoco.rollout")
        strayed = peers[0]["q_difference_rad"]
        error = f"joints within {f'{strayed:.0e}' if strayed else '0'} rad of rollout's"
        own = _only(rows, what="the environment")
        ours, its = (number(row["us_per_action"]) or 0.0 for row in (own, peers[0]))
        what = "10 ms of an arm with drives, observations and rewards"
        peer = "mujoco.rollout of the bare physics"
        yield _line(what, (ours, error), peer, (its, "same motion"))


def _online(studies: Studies) -> Iterator[Row]:
    """A simulated millisecond from the scene to the alarm, and the kernel sum of one sample."""
    for row in rows_of(studies, "detection_online", "real time"):
        error = f"score within {row['difference_to_online']:.0e} of the offline one"
        what = "1 ms of arm, drives, observer and detector"
        its = number(row["peer_us"]) or 0.0, "same motion"
        yield _line(what, (row["total_us"], error), "mujoco.rollout of the bare arm", its)
    rows = rows_of(studies, "detection_online", "kernel")[:1]
    for row in rows:
        error = f"output within {row['difference_to_sklearn']:.0e}"
        its = number(row["sklearn_us"]) or 0.0, "the reference"
        what = f"the SVR's output, {row['support_vectors']} support vectors"
        yield _line(what, (number(row["us"]) or 0.0, error), "scikit-learn's predict", its)


# -- detection -------------------------------------------------------------------------------------


def detection(studies: Studies, gaps: Gaps) -> list[Row]:
    """What detectors find and how often they are wrong: simulated arms, then real ones."""
    return _lines({"detection": _simulated, "real_arm": _real}, studies, gaps)


def _simulated(studies: Studies) -> Iterator[Row]:
    """Every detector at the threshold for a rate of false alarms, all speeds together."""
    rows = [r for r in rows_of(studies, "detection", "hourly") if r["speed"] == 0]
    for row in rows:
        delay = row["delay_ms"]
        yield {
            "tried on": "simulated arms",
            "detector": row["detector"],
            f"found {FROM}": _share(row["sensitivity"]),
            "false alarms an hour": cell(row["false_alarms_per_hour"]),
            "median delay": "-" if delay["median"] is None else f"{delay['median']:.0f} ms",
            "95 % within": "-" if delay["p95"] is None else f"{delay['p95']:.0f} ms",
        }


def _real(studies: Studies) -> Iterator[Row]:
    """Pushes on the UR5 and the free minutes of all real arms."""
    free: dict[str, list[float]] = {}
    for row in rows_of(studies, "real_arm", "false alarms"):
        sums = free.setdefault(row["detector"], [0.0, 0.0])
        sums[0] += row["alarms"]
        sums[1] += row["minutes"]
    for row in rows_of(studies, "real_arm", "pushes"):
        alarms, minutes = free.get(row["detector"], (0.0, 0.0))
        yield {
            "tried on": f"{row['arm']}, {row['state']}",
            "detector": row["detector"],
            "found": _share(row["found"]),
            "found by chance": row["by chance"],
            "median delay": _ms(row["median delay ms"]),
            "false alarms on all arms": f"{alarms:.0f} in {minutes:.0f} min",
        }


def _share(rate: Mapping[str, Any]) -> str:
    found, of = _count([rate])
    return f"{found} of {of} ({cell(rate)})"


def _ms(value: float | None) -> str:
    return "-" if value is None else f"{value:.0f} ms"
