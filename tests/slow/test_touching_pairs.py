"""A million degenerate pairs of each kind: all are hits, and their weights reach the contact."""

import pytest

from oracles.touching_pairs import KINDS, gap_of_weights, touching
from tauguard.cloth import edge_edge, vertex_face

#: Pairs of each kind, and of one call.
COUNT, CHUNK = 1_000_000, 100_000

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("kind", KINDS)
def test_a_million_pairs(kind, slow_seed, counts):
    hits, wrong, largest, relative = 0, 0, 0.0, 0.0
    for chunk in range(COUNT // CHUNK):
        vertex, x_t0, x_t1 = touching(kind, slow_seed * COUNT + chunk, CHUNK)
        found = (vertex_face if vertex else edge_edge)(x_t0, x_t1)
        gap, bound = gap_of_weights(vertex, x_t0, x_t1, found.toi, found.point, found.weights)
        hits += int(found.hit.sum())
        wrong += int((~(gap <= bound) | (found.weights < 0).any(axis=1)).sum())
        largest, relative = max(largest, gap.max()), max(relative, (gap / bound).max())
    counts(pairs=COUNT, hits=hits, largest=f"{largest:.1e}", of_bound=f"{relative:.2f}")
    assert (hits, wrong) == (COUNT, 0)
