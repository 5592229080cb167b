"""Time of impact of convex bodies that move and turn, against advancement with coal's distance.

For boxes and tetrahedra the truth is a bracket around the first contact, from code that shares
nothing with the code under test (`oracles.convex_impact`). For bodies with radii, coal's
distance is the judge: at the time found and at 24 moments before it. coal has no continuous
query. The peer is therefore the textbook method over coal's distance: step by the distance
divided by the largest speed.
"""

import numpy as np
from numpy.typing import NDArray

from oracles import coal_peer
from oracles.coal_motion import MovingDistance, advanced_times
from oracles.convex_impact import AxisGap, bracket, impact_errors
from oracles.convex_pairs import farthest, moving_pairs, random_bodies, random_motions, take
from studies.framework import table_rows
from studies.rigid import peer
from studies.rigid.bars import count, error, within
from studies.rigid.distance import ROUNDED
from tauguard.report import Row
from tauguard.rigid import Impacts, time_of_impact

NOTES = {
    "time of impact": "bodies about 2 m apart that move by up to 2 m and turn by less than half "
    "a turn. us_hit, us_miss: time for a pair that touches, and that stays apart; coal's are its "
    "distance calls alone. Errors are relative to a bracket of the first contact; undecided: "
    "pairs whose distance is below the bracket's resolution.",
    "motion of bodies with radii": "both bodies turn; times as above. met_before: pairs in contact "
    "before the time found, by coal's distance; distance_at_toi: coal's largest distance at that "
    "time [m]; coal_disagrees: hits that differ (coal's advancement stops at 1e-6 m).",
}
#: Least number of pairs in a timed call.
LEAST = 500


def measure(quick: bool, seed: int) -> list[Row]:
    """Measure two rows (ours, peer) for each kind of body, and one for each pair with radii."""
    rng = np.random.default_rng(seed)
    rows: list[Row] = []
    for kind in ("boxes", "tetrahedra"):
        rows += impact_rows(rng, kind, 300 if quick else 2_000)
    rows += [rounded_row(rng, kinds, 20 if quick else 1_000) for kinds in ROUNDED]
    return rows + summary(rows, quick)


def summary(rows: list[Row], quick: bool) -> list[Row]:
    """Late and missed contacts, errors, and the time of a hit."""
    own = [row for row in table_rows(rows, "time of impact") if row["method"] == "tauguard"]
    radii = table_rows(rows, "motion of bodies with radii")
    late = [count(row[key]) for row in own for key in ("late", "missed")]
    return [
        error("time of impact: late or missed", 0, late),
        error("time of impact: largest error", 1e-7, [row["toi_error_max"] for row in own]),
        within("time of impact: us a hit", 20, [row["us_hit"]["median"] for row in own], quick),
        error("bodies with radii: met before, by coal", 0, [row["met_before"] for row in radii]),
        error("radii: coal's distance at the hit", 1e-6, [row["distance_at_toi"] for row in radii]),
    ]


def impact_rows(rng: np.random.Generator, kind: str, n: int) -> list[Row]:
    """Times and errors of ``time_of_impact``, and of advancement that uses coal's distances."""
    a, b, ma, mb = moving_pairs(rng, kind, n)
    early, touch = bracket(a, b, ma, mb)

    def call(index: NDArray[np.intp]) -> Impacts:
        return time_of_impact(take(a, index), take(b, index), take(ma, index), take(mb, index))

    toi = time_of_impact(a, b, ma, mb).time_of_impact
    shapes = coal_peer.geometries(a), coal_peer.geometries(b)
    distance = MovingDistance(shapes, (ma, mb), signed=False)
    coal_toi = advanced_times(distance, np.arange(n), AxisGap(a, b, ma, mb).speed)
    us = {
        f"us_{name}": 1e6 * float(distance.seconds[rows].mean()) if len(rows) else None
        for name, rows in peer.outcomes(touch).items()
    }
    base: Row = {"study": "time of impact", "bodies": kind, "pairs": n}
    over_coal = {"method": "advancement over coal's distance", **us}
    return [
        {
            **base,
            "method": "tauguard",
            **peer.times(call, touch, LEAST),
            **impact_errors(early, touch, toi),
        },
        {**base, **over_coal, **impact_errors(early, touch, coal_toi)},
    ]


def rounded_row(rng: np.random.Generator, kinds: tuple[str, str], n: int) -> Row:
    """Time of impact of one kind of pair with radii, both turning."""
    a, b = (random_bodies(rng, kind, n, 0.0) for kind in kinds)
    ma, mb = random_motions(rng, n, 0.3, 0.3), random_motions(rng, n, 2.5, 2.5)
    shapes = coal_peer.geometries(a), coal_peer.geometries(b)
    distance = MovingDistance(shapes, (ma, mb), signed=True)

    def call(rows: NDArray[np.intp]) -> Impacts:
        return time_of_impact(take(a, rows), take(b, rows), take(ma, rows), take(mb, rows))

    columns = peer.motion_columns(call, distance, farthest(a) + farthest(b), least=LEAST)
    return {"study": "motion of bodies with radii", "pair": "-".join(kinds), **columns}
