"""The smallest part of the contacts study, run as a user runs it."""

import pytest


@pytest.mark.slow
def test_checkers_are_compared(bench):
    found, _ = bench("contacts-checkers")
    rows = {
        (row["scene"], row["checker"]): row for row in found["rows"] if row["study"] == "scenes"
    }
    assert rows["ball_cloth", "cloth"]["recall"]["value"] == 1
    assert rows["sphere_plate", "rigid"]["recall"]["value"] == 1
    assert rows["sphere_plate", "cloth"]["recall"]["n"] == 0
    flights = [row for row in found["rows"] if row["study"] == "crossing"]
    assert all(row["cloth_recall"]["value"] == 1 for row in flights)
    assert max(row["cloth_time_error"] for row in flights) < 1e-6
