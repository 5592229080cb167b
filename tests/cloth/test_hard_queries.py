"""The public hard queries with exact truth (Sample-Queries, Wang et al. 2021): right, always."""

import numpy as np
import pytest

from oracles.mesh_contact import judge
from oracles.recorded_collisions import QUERY_SETS, load_queries
from tauguard.cloth import edge_edge, vertex_face


@pytest.mark.data
@pytest.mark.parametrize("name", QUERY_SETS)
@pytest.mark.parametrize("kind", ["edge-edge", "vertex-face"])
def test_hits_are_the_listed_ones(data_dir, name, kind):
    x, truth = load_queries(data_dir / "ccd" / name / kind)
    start, end = x[:, 0], x[:, 1]
    query = edge_edge if kind == "edge-edge" else vertex_face
    for scale in (1.0, 2.0**-300, 2.0**300):
        assert np.array_equal(query(scale * start, scale * end).hit, truth)
    assert np.array_equal(query(end, start).hit, truth)
    order = [0, 2, 3, 1] if kind == "vertex-face" else [3, 2, 0, 1]
    assert np.array_equal(query(start[:, order], end[:, order]).hit, truth)


@pytest.mark.data
@pytest.mark.parametrize("name", QUERY_SETS)
@pytest.mark.parametrize("kind", ["edge-edge", "vertex-face"])
def test_exact_gives_the_listed_hits_and_the_last_word_on_times(data_dir, name, kind):
    x, truth = load_queries(data_dir / "ccd" / name / kind)
    start, end = x[:, 0], x[:, 1]
    query = edge_edge if kind == "edge-edge" else vertex_face
    exact, ours = (query(start, end, method=m) for m in ("exact", "ab2pf"))
    assert np.array_equal(exact.hit, truth)
    early = exact.toi[truth] - ours.toi[truth]
    assert early.min(initial=0) >= 0
    assert early.max(initial=0) <= 1e-9


@pytest.mark.data
@pytest.mark.parametrize("kind", ["edge-edge", "vertex-face"])
def test_integers_agree_with_the_labels_and_with_every_answer(data_dir, kind):
    query = edge_edge if kind == "edge-edge" else vertex_face
    for name in QUERY_SETS:
        x, truth = load_queries(data_dir / "ccd" / name / kind)
        found = judge(x, kind == "vertex-face", query(x[:, 0], x[:, 1]).toi)
        assert np.array_equal(found.hit, truth)
        assert (found.misses, found.false_hits, found.late) == (0, 0, 0)
        assert found.early_most <= 1e-9
