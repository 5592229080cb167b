"""The report: studies are run once, a failure stops nothing, the page holds what was found."""

import json

import pytest

from tauguard.benchmarks import bound, collect, glance, panels
from tauguard.cli import main, mistakes
from tauguard.report import rate, versions


def payload(rows, processor="P"):
    on = {"processor": processor, "cores": 2, "system": "Linux"}
    what = {"name": "simulation", "quick": True, "seed": 0, "machine": on}
    return what | {"versions": versions(), "rows": rows}


TIME = {"median": 5.0, "low": 4.0, "high": 6.0}
STEP = {"study": "timestep", "timestep_ms": 1.0, "us_per_simulated_ms": TIME}
ROWS = [
    {"study": "cost", "scene": "ideal drive", "us_per_step": TIME, "ratio_to_rollout": 1.1},
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
    bar = {"study": "summary", "question": "how far", "asked": "1", "measured": "2", "met": False}
    (tmp_path / "simulation.json").write_text(json.dumps(payload([*ROWS, bar])))
    (tmp_path / "endurance.json").write_text(json.dumps(payload([], "another")))
    case = {"case": "c", "library": "tauguard", "kind": "scene", "expected": "1", "answer": "2"}
    cases = [case | {"right": False, "why": "hard", "origin": "here", "explained": "soft"}]
    failed = {"rigid": "it broke", "endurance": "stopped"}
    text = bound.bind(tmp_path, cases, failed, "<p>look</p>").read_text()
    for part in ("ideal drive", "rigid (it broke)", "hard", "soft", "Study: simulation", "0 of 1"):
        assert part in text
    for part in ("data:image/svg+xml", "<p>look</p>", "0 of 1 bars", "how far", "P, 2 cores"):
        assert part in text
    assert "another" not in text  # the file of a study that failed now is not shown
    assert "Study: rigid" not in text
    assert not list(tmp_path.glob("*.part"))


def test_rows_become_points_only_with_both_figures():
    (panel,) = panels.panels({"simulation": ROWS})
    assert [(p.label, p.cost, p.error) for p in panel.points] == [
        ("1 ms", 5.0, 1e-4),
        ("2 ms", 5.0, 2e-4),
    ]


def test_convex_methods_are_weighted_by_their_pairs():
    def row(n, wrong):
        return {"study": "table 2.1 static", "auto_ns": 1e3, "auto_wrong": rate(wrong, n)}

    (panel,) = panels.panels({"rigid": [row(10, 1), row(30, 0)]})
    (point,) = panel.points
    assert (point.cost, point.error) == (1.0, pytest.approx(1 / 40))


def test_the_first_table_has_time_and_error_of_both_and_their_ratio():
    row = {"study": "table 2.1 static", "auto_ns": TIME, "auto_wrong": rate(1, 2000)}
    row |= {"coal_net_ns": 2500.0, "coal_wrong": rate(0, 10)}
    (line,) = glance.kernels({"rigid": [row, row]})
    assert line["tauguard takes"] == "5 ns"
    assert line["tauguard's error"] == "2 wrong of 4,000"
    assert (line["peer takes"], line["peer's error"]) == ("2.5 µs", "0 wrong of 20")
    assert line["peer / tauguard"] == "500"
    assert glance.detection({}) == []


def test_false_alarms_of_real_arms_are_those_of_all_their_minutes():
    push = {"study": "pushes", "arm": "a", "state": "moving", "detector": "d", "by chance": 0.1}
    push |= {"found": rate(9, 10), "median delay ms": None}
    free = {"study": "false alarms", "detector": "d", "alarms": 2, "minutes": 3.0}
    (line,) = glance.detection({"real_arm": [push, free, free]})
    assert line["found"].startswith("9 of 10 (0.900 [")
    assert line["false alarms on all arms"] == "4 in 6 min"
    assert line["median delay"] == "-"


def test_mistakes_are_made_once_and_linked(tmp_path, monkeypatch):
    made = []

    def judged(folder, seed):
        made.append(seed)
        rows = [{"kind": "missed", "file": "missed-001.rrd", "at [s]": 1.5}]
        return {"counts": "1 missed, 0 late, 0 false alarm", "rows": rows}

    monkeypatch.setattr(mistakes, "judged", judged)
    text = mistakes.mistakes(tmp_path, 3)
    assert mistakes.mistakes(tmp_path, 3) == text
    assert made == [3]
    assert 'href="open/wrong/missed-001.rrd"' in text
    assert f"replay --web {tmp_path}" in text


def test_an_unknown_study_is_refused(tmp_path, capsys):
    with pytest.raises(SystemExit) as stop:
        main(["report", "--out", str(tmp_path), "--study", "nothing"])
    assert stop.value.code == 2
    assert "there are simulation" in capsys.readouterr().err
