"""The study rigid: what its rows hold and that a wrong answer would show."""

import numpy as np
import pytest

from tauguard.benchmarks import rigid_convex
from tauguard.rigid import overlap


def test_a_static_cell_counts_wrong_answers():
    rng = np.random.default_rng(0)
    cells = rigid_convex.static_cells(rng, ("tetrahedra", "tetrahedra"), 200, 20)
    assert [outcome for outcome, _, _ in cells] == ["collision", "non-collision"]
    _, a, b = cells[0]
    row = rigid_convex.static_row(("tetrahedra", "tetrahedra"), "collision", a, b, 50)
    assert row["pairs"] == 200
    for name in rigid_convex.METHODS:
        assert row[f"{name}_wrong"]["value"] == 0
        assert row[f"{name}_ns"]["median"] > 0
    swapped = rigid_convex.static_row(("tetrahedra", "tetrahedra"), "non-collision", a, b, 50)
    assert swapped["abfme_wrong"]["value"] == 1
    assert swapped["published"] == 1.12


def test_dynamic_rows_name_the_un_inverted_entries():
    pair = ("parallelepipeds", "tetrahedra")
    collision, clear = rigid_convex.dynamic_rows(np.random.default_rng(1), pair, 100, 20)
    assert collision["pairs"] + clear["pairs"] == 200
    assert "2.58 and 1.37" in collision["note"]
    assert collision["late_of_sample"]["value"] == 0
    assert collision["toi_error_max"] < 1e-9


def test_cached_planes_give_fresh_answers():
    for row in rigid_convex.coherent_rows(np.random.default_rng(3), 300, 3):
        assert row["differs_from_fresh"]["value"] == 0
        assert row["answered_by_cache"]["value"] > 0.8


def test_coal_agrees_away_from_contact():
    pytest.importorskip("coal")
    rng = np.random.default_rng(2)
    for pair in rigid_convex.PAIRS:
        for outcome, a, b in rigid_convex.static_cells(rng, pair, 100, 10):
            assert (overlap(a, b, "gjk").hit == (outcome == "collision")).mean() > 0.98
