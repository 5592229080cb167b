"""The study of real arms: quick runs of its parts."""

import pytest


@pytest.fixture
def no_logs(tmp_path, monkeypatch):
    monkeypatch.setenv("TAUGUARD_DATA", str(tmp_path))


@pytest.mark.usefixtures("no_logs")
def test_it_says_so_where_there_are_no_logs(bench):
    file, said = bench("real_arm")
    assert len(file["rows"]) == 1
    assert "no logs: set TAUGUARD_DATA to their folder" in said


@pytest.mark.usefixtures("no_logs")
def test_a_drawn_arm_is_trained_with_minutes_and_finds_pushes(bench):
    file, _ = bench("real_arms", "--part", "training")
    (row,) = file["rows"]
    assert row["seconds"] == 120.0
    assert row["pushes"] > 0
    assert 2 < row["moving N"] < 500


@pytest.mark.data
def test_pushes_of_real_arms_are_found_beside_the_rules(bench, data_dir):
    file, _ = bench("real_arm")
    pushes = [row for row in file["rows"] if row["study"] == "pushes" and row["arm"] == "ur5"]
    moving = {row["detector"]: row for row in pushes if row["state"] == "moving"}
    assert set(moving) == {"ours", "plain observer", "1 A", "10 N m"}
    assert moving["ours"]["found"]["n"] == 11
    assert moving["ours"]["found"]["value"] > moving["ours"]["by chance"]
