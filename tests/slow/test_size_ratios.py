"""Bodies of very different sizes: signs, lengths and times against fractions, in every order."""

import pytest

from oracles.size_ratios import BOUND
from slow.size_ratio_jobs import bodies, meshes, moving, rows

#: Pairs of bodies (each asked in four forms), of a mesh and a body (in two), of moving bodies.
PAIRS, MESHES, MOVING = 200_000, 20_000, 8_000

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(("judge", "count"), [(bodies, PAIRS), (meshes, MESHES)])
def test_distances(judge, count, slow_seed, counts):
    found = rows(judge, slow_seed, count)
    wrong = sum(row.signs for row in found)
    far = sum(row.error > BOUND for row in found)
    answers = sum(row.answers for row in found)
    error = max(row.error for row in found)
    counts(answers=answers, wrong_signs=wrong, wrong_lengths=far, largest_error=f"{error:.1e}")
    assert not wrong
    assert not far


def test_times_of_impact(slow_seed, counts):
    found = rows(moving, slow_seed, MOVING)
    hits = sum(row.hit for row in found)
    missed, late, false = (
        sum(getattr(row, k) for row in found) for k in ("missed", "late", "false")
    )
    early, apart = max(row.early for row in found), max(row.apart for row in found)
    counts(
        hits=hits,
        missed=missed,
        late=late,
        false_hits=false,
        earliest=f"{early:.1e}",
        apart_at_a_false_hit=f"{apart:.1e}",
    )
    assert hits >= MOVING // 2
    assert not missed
    assert not late
