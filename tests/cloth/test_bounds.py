"""What a query can cost is bounded, and the bounds are those that the documentation states."""

from time import process_time

import numpy as np
import pytest

from oracles.adversarial_queries import KINDS
from tauguard.cloth import edge_edge, vertex_face
from tauguard.cloth.comparators import METHODS, ComparedMeshCCD
from tests.cloth.solve import solve_each

QUERIES = {"vf": vertex_face, "ee": edge_edge}
# Of time, a query: 41 cuts in three at most, or 4001 in two.
INTERVALS, INTERVALS_WITH_DISTANCE = 1 + 3 * 41, 1 + 2 * 4_001


@pytest.mark.parametrize("kind", QUERIES)
@pytest.mark.parametrize("name", KINDS)
def test_a_query_is_cut_into_so_many_intervals_at_most(kind, name):
    x = KINDS[name](np.random.default_rng(0), 300, kind == "vf")
    found = solve_each(kind == "vf", x).counts
    assert found["intervals"] <= INTERVALS * found["resolved"]
    assert found["exact"] <= len(x)  # each is decided exactly once at most
    for one in x[:20]:
        few = solve_each(kind == "vf", one[None], distance=0.1).counts
        assert few["intervals"] <= INTERVALS_WITH_DISTANCE


@pytest.mark.parametrize("kind", QUERIES)
def test_the_widest_span_of_magnitudes_takes_less_than_a_second(kind):
    """Flat, so that no filter tells, and with numbers of some thousand bits."""
    rng = np.random.default_rng(1)
    x = rng.normal(size=(1, 2, 4, 3)) * 10.0 ** rng.integers(-300, 300, size=(1, 2, 4, 3))
    x[..., 2] = 0
    x[:, :, 0, 0] = 0
    for worst in (x, x[:, ::-1]):
        start = process_time()
        QUERIES[kind](worst[:, 0], worst[:, 1])
        assert process_time() - start < 1


def test_exact_queries_have_no_minimum_distance():
    x = np.zeros((1, 4, 3))
    for call in QUERIES.values():
        with pytest.raises(ValueError, match="expected 0, or method ab2pf"):
            call(x, x, method="exact", min_distance=0.1)


@pytest.mark.parametrize("method", [m for m in METHODS if m != "ab2pf"])
def test_meshes_say_which_method_has_a_minimum_distance(method):
    with pytest.raises(ValueError, match="expected 0, or method ab2pf"):
        ComparedMeshCCD([[0, 1, 2]], method=method).find(np.eye(3), np.eye(3), min_distance=0.1)
