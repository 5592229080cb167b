"""The public hard queries with exact truth (Sample-Queries, Wang et al. 2021): no miss, ever."""

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
def test_no_hit_is_missed(data_dir, name, kind):
    x, truth = load(data_dir / "ccd" / name / kind)
    query = edge_edge if kind == "edge-edge" else vertex_face
    for scale in (1.0, 2.0**-300, 2.0**300):
        hit = query(scale * x[:, :4], scale * x[:, 4:]).hit
        assert not (truth & ~hit).any()
        assert (hit & ~truth).mean() < 0.45  # a false hit is a figure, not an error
    backwards = query(x[:, 4:], x[:, :4]).hit
    assert not (truth & ~backwards).any()
    turned = query(x[:, [0, 2, 3, 1]], x[:, [4, 6, 7, 5]]).hit if kind == "vertex-face" else truth
    assert not (truth & ~turned).any()
