"""The public hard queries with exact truth (Sample-Queries, Wang et al. 2021): right, always."""

import numpy as np
import pytest

from tauguard.cloth import edge_edge, vertex_face

SETS = [
    "unit-tests",
    "erleben-cube-cliff-edges",
    "erleben-sliding-spike",
    "erleben-spike-hole",
    "erleben-spike-wedge",
    "erleben-wedges",
]


def load(folder):
    """Queries (N, 8, 3) and their truth; every rational is an exact double."""
    x, truth = [], []
    for file in sorted(folder.glob("*.csv")):
        rows = [[int(cell) for cell in line.split(",")] for line in file.read_text().split()]
        x += [[row[2 * k] / row[2 * k + 1] for k in range(3)] for row in rows]
        truth += [bool(row[6]) for row in rows[::8]]
    return np.array(x).reshape(-1, 8, 3), np.array(truth)


@pytest.mark.data
@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("kind", ["edge-edge", "vertex-face"])
def test_hits_are_the_listed_ones(data_dir, name, kind):
    x, truth = load(data_dir / "ccd" / name / kind)
    query = edge_edge if kind == "edge-edge" else vertex_face
    for scale in (1.0, 2.0**-300, 2.0**300):
        assert np.array_equal(query(scale * x[:, :4], scale * x[:, 4:]).hit, truth)
    assert np.array_equal(query(x[:, 4:], x[:, :4]).hit, truth)
    order = [0, 2, 3, 1] if kind == "vertex-face" else [3, 2, 0, 1]
    assert np.array_equal(query(x[:, :4][:, order], x[:, 4:][:, order]).hit, truth)


@pytest.mark.data
@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("kind", ["edge-edge", "vertex-face"])
def test_exact_gives_the_listed_hits_and_the_last_word_on_times(data_dir, name, kind):
    x, truth = load(data_dir / "ccd" / name / kind)
    query = edge_edge if kind == "edge-edge" else vertex_face
    exact, ours = (query(x[:, :4], x[:, 4:], method=m) for m in ("exact", "ab2pf"))
    assert np.array_equal(exact.hit, truth)
    early = exact.toi[truth] - ours.toi[truth]
    assert early.min(initial=0) >= 0
    assert early.max(initial=0) <= 1e-9
