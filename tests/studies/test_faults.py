"""The study of faults: quick runs of its parts."""

import pytest


@pytest.mark.slow
def test_a_fault_of_samples_is_reported_and_clean_logs_have_none(bench):
    file, _ = bench("faults-samples")
    clean = [row for row in file["rows"] if row["study"] == "clean"]
    assert clean
    assert all(row["false_fault_s"] == 0 for row in clean)
    assert all(row["alarms"] == row["alarms_of_detect"] for row in clean)
    faults = {row["fault"]: row for row in file["rows"] if row["study"] == "faults"}
    assert {"frozen", "missing", "nan"} <= set(faults)
    for name in ("frozen", "missing", "nan"):
        assert faults[name]["seen"]["value"] == 1
        assert faults[name]["median_ms"] < 150


@pytest.mark.slow
def test_a_played_log_is_heard_whole(bench):
    file, _ = bench("listen")
    heard = [row for row in file["rows"] if row["study"] == "listen"]
    assert [row["rate [Hz]"] for row in heard] == [125.0, 500.0]
    for row in heard:
        assert row["lost"] == 0
        assert row["heard"] > 0
