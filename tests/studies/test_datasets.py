"""The smallest part of the study datasets, through the command line."""

import pytest


@pytest.mark.slow
def test_a_detector_has_its_row_on_every_split_of_a_small_dataset(bench):
    payload, said = bench("datasets-entries")
    rows = [row for row in payload["rows"] if row["study"] == "entries"]
    assert {row["split"] for row in rows} == {"test"}
    (row,) = rows
    assert row["detector"] == "residual-thresholds"
    assert row["from_16"]["n"] > 0
    assert row["from_16"]["value"] > 0.5
    assert "residual-thresholds" in said
