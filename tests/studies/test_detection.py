"""The study of collision detection: quick runs of its parts."""

import pytest


@pytest.fixture
def own_detector(tmp_path, monkeypatch):
    """A detector of a user's own, as module:Class."""
    (tmp_path / "mine.py").write_text(
        "from dataclasses import dataclass\n"
        "import numpy as np\n"
        "@dataclass(frozen=True)\n"
        "class Fitted:\n"
        "    arm: object\n"
        "    dt: float\n"
        "    name: str = 'size'\n"
        "    settle: float = 0.0\n"
        "    def scores(self, trace): return np.abs(trace.current).max(axis=1)\n"
        "class Size:\n"
        "    name = 'size'\n"
        "    def fit(self, traces, arm): return Fitted(arm, traces[0].dt)\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    return "mine:Size"


@pytest.mark.slow
def test_the_experiment_has_the_dissertations_cells_beside_a_detector_of_ones_own(
    bench, own_detector
):
    file, said = bench("detection", "--detector", own_detector)
    assert file["name"] == "detection-experiment"
    assert "headline: " in said
    tables = {}
    for row in file["rows"]:
        tables.setdefault(row["study"], []).append(row)
    cells = {(row["detector"], row["speed"], row["threshold_a"]) for row in tables["speed"]}
    assert len(cells) == 4 * 6 * 2
    assert ("mine:Size", 60.0, 2.0) in cells
    printed = [row for row in tables["dissertation"] if row["detector"] == "srq-svr"]
    assert printed[0]["theirs"] == "60,5,29,113"
    for row in tables["dissertation"]:
        assert sum(map(int, row["theirs"].split(",")[:2])) == 65
        tp, fn, fp, tn = map(int, row["ours"].split(","))
        assert row["sensitivity"]["value"] == tp / (tp + fn)
        assert row["specificity"]["value"] == tn / (tn + fp)
    assert len(tables["headline"]) == 12
    whole = [row for row in tables["hourly"] if row["speed"] == 0 and row["detector"] == "srq-svr"]
    assert whole[0]["sensitivity"]["value"] > 0.9
    assert whole[0]["hours"] >= 0.09


@pytest.mark.slow
def test_false_alarms_are_counted_beside_the_rate_asked_for(bench):
    file, _ = bench("false_alarms")
    rows = {(r["detector"], r["threshold"], r["asked"]): r for r in file["rows"]}
    assert len(rows) == 2 * 2 * 2
    for (_, way, _), row in rows.items():
        assert row["found"]["hours"] > 0 or (way == "guaranteed" and row["refused"] == 1)
    for name in ("srq-svr", "moving-thresholds"):
        few, many = (rows[name, "aimed at", asked]["found"]["n"] for asked in (5.0, 30.0))
        assert few <= many


@pytest.mark.slow
def test_a_robot_is_judged_by_its_own_torques(bench):
    file, _ = bench("detection", "--robot", "cura6-small")
    assert file["name"] == "detection-robots"
    names = [row["detector"] for row in file["rows"]]
    assert names == ["srq-svr", "moving-thresholds", "residual-thresholds"]
    ours = file["rows"][0]
    assert 0 < ours["share"] < 1
    assert ours["sensitivity"]["value"] > 0.8


@pytest.mark.slow
def test_slow_logs_have_a_row_for_each_rate(bench):
    file, _ = bench("detection-sampling")
    rows = {(row["hz"], row["detector"]): row for row in file["rows"]}
    assert set(rows) == {(hz, n) for hz in (23.8, 100.0) for n in ("srq-svr", "moving-thresholds")}
    slow, fast = (rows[hz, "srq-svr"]["sensitivity"]["value"] for hz in (23.8, 100.0))
    assert 0.5 < slow <= fast


@pytest.mark.slow
def test_a_sample_online_has_the_score_of_the_batch(bench):
    file, _ = bench("detection_online")
    steps = [row for row in file["rows"] if row["study"] == "step"]
    assert [row["detector"] for row in steps] != []
    assert all(row["difference_to_batch"] < 1e-9 for row in steps)
    full, *fewer = (row for row in file["rows"] if row["study"] == "kernel")
    assert full["error_max"] == 0
    assert full["difference_to_sklearn"] < 1e-9
    assert all(row["error_max"] > 0 for row in fewer)
    assert fewer[-1]["us"]["median"] < full["us"]["median"]


@pytest.mark.slow
def test_diagnosis_names_links_kinds_and_forces(bench):
    file, _ = bench("diagnosis")
    tables = {row["study"] for row in file["rows"]}
    assert tables == {"link", "contact", "kind", "payload", "severity", "cost"}
    right = {
        row["method"]: row["link_right"]["value"]
        for row in file["rows"]
        if row["study"] == "link" and row["group"] == "all"
    }
    assert right["exact"] >= right["usual"]
    for row in file["rows"]:
        if row["study"] == "kind":
            said = sum(value for key, value in row.items() if key.startswith("said_"))
            assert said == row["kind_right"]["n"]
