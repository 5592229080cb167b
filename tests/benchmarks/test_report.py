"""The report: studies are run once, a failure stops nothing, the page holds what was found."""

import json

import pytest

from tauguard.benchmarks import bound, collect, panels
from tauguard.cli import main
from tauguard.report import rate, versions


def payload(rows):
    return {"name": "simulation", "quick": True, "seed": 0, "versions": versions(), "rows": rows}


TIME = {"median": 5.0, "low": 4.0, "high": 6.0}
STEP = {"study": "timestep", "timestep_ms": 1.0, "us_per_simulated_ms": TIME}
ROWS = [
    {"study": "cost", "scene": "ideal drive", "us_per_step": 3.0, "ratio_to_rollout": 1.1},
    STEP | {"q_error_rad": 1e-4},
    STEP | {"timestep_ms": 2.0, "q_error_rad": 2e-4},
    STEP | {"timestep_ms": 4.0, "q_error_rad": None},
]


def test_what_is_there_is_not_run_again(tmp_path, monkeypatch):
    (tmp_path / "simulation.json").write_text(json.dumps(payload([])))
    ran = []

    def study(folder, name, quick, seed):
        ran.append(name)
        return "it broke" if name == "rigid" else None

    monkeypatch.setattr(collect, "_study", study)
    names = ("simulation", "rigid", "impact")
    assert collect.collect(tmp_path, names, quick=True, seed=0) == {"rigid": "it broke"}
    assert ran == ["rigid", "impact"]
    collect.collect(tmp_path, ("simulation",), quick=True, seed=1)
    assert ran[-1] == "simulation"


def test_a_process_that_fails_says_why(tmp_path):
    failed = collect.collect(tmp_path, ("nothing",), quick=True, seed=0)
    assert "no study 'nothing'" in failed["nothing"]


def test_the_page_holds_the_studies_the_cases_and_what_is_missing(tmp_path):
    (tmp_path / "simulation.json").write_text(json.dumps(payload(ROWS)))
    case = {"case": "c", "library": "ours", "kind": "scene", "expected": "1", "answer": "2"}
    cases = [case | {"right": False, "why": "hard", "origin": "here"}]
    text = bound.bind(tmp_path, cases, {"rigid": "it broke"}).read_text()
    for part in ("ideal drive", "it broke", "hard", "Study: simulation", "data:image/svg+xml"):
        assert part in text
    assert "Study: rigid" not in text
    assert not list(tmp_path.glob("*.part"))


def test_rows_become_points_only_with_both_figures():
    (panel,) = panels.panels("simulation", ROWS)
    assert [(p.label, p.cost, p.error) for p in panel.points] == [
        ("1 ms", 5.0, 1e-4),
        ("2 ms", 5.0, 2e-4),
    ]


def test_convex_methods_are_weighted_by_their_pairs():
    def row(n, wrong):
        return {"study": "table 2.1 static", "auto_ns": 1e3, "auto_wrong": rate(wrong, n)}

    (panel,) = panels.panels("rigid", [row(10, 1), row(30, 0)])
    (point,) = panel.points
    assert (point.cost, point.error) == (1.0, pytest.approx(1 / 40))


def test_an_unknown_study_is_refused(tmp_path, capsys):
    with pytest.raises(SystemExit) as stop:
        main(["report", "--out", str(tmp_path), "--study", "nothing"])
    assert stop.value.code == 2
    assert "there are simulation" in capsys.readouterr().err
