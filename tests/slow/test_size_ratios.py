"""Bodies of very different sizes: signs, lengths and times against fractions, in every order."""

from itertools import product
from multiprocessing import get_context

import numpy as np
import pytest

from oracles import size_ratios

#: Pairs of bodies (each asked in four forms), of a mesh and a body (in two), of moving bodies.
PAIRS, MESHES, MOVING = 50_000, 5_000, 4_000
#: Rows that one process takes at a time.
CHUNK = 50
#: Bodies of full dimension: the others' exact time of impact is not known.
SOLID = ("tetrahedra", "boxes", "parallelepipeds")

pytestmark = pytest.mark.slow


def bodies(seed):
    rng = np.random.default_rng(seed)
    kinds = list(product(size_ratios.KINDS, repeat=2))
    rows = []
    for _ in range(CHUNK):
        pair = size_ratios.pair(rng, kinds[rng.integers(len(kinds))])
        rows.append(size_ratios.judged(*pair, int(rng.integers(-100, 101))))
    return rows


def meshes(seed):
    rng = np.random.default_rng(seed)
    return [size_ratios.mesh_error(rng, str(rng.choice(size_ratios.KINDS))) for _ in range(CHUNK)]


def moving(seed):
    rng = np.random.default_rng(seed)
    rows = []
    for _ in range(CHUNK):
        kinds = str(rng.choice(SOLID)), str(rng.choice(SOLID))
        rows.append(size_ratios.timed(rng, kinds, int(rng.integers(-60, 61))))
    return rows


def drawn(task, seed, count):
    with get_context("spawn").Pool() as pool:
        seeds = [(seed, number) for number in range(count // CHUNK)]
        return [row for rows in pool.imap(task, seeds) for row in rows]


@pytest.mark.parametrize(("task", "count"), [(bodies, PAIRS), (meshes, MESHES)])
def test_distances(task, count, slow_seed, counts):
    found = drawn(task, slow_seed, count)
    wrong = sum(row.signs for row in found)
    far = sum(row.error > size_ratios.BOUND for row in found)
    answers = sum(row.answers for row in found)
    error = max(row.error for row in found)
    counts(answers=answers, wrong_signs=wrong, wrong_lengths=far, largest_error=f"{error:.1e}")
    assert not wrong
    assert not far


def test_times_of_impact(slow_seed, counts):
    found = drawn(moving, slow_seed, MOVING)
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
