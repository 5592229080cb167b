"""The report: studies are run once, a failure stops nothing, the page holds what was found."""

import base64
import json
import re
from html import escape

import pytest

from studies import bound, collect, glance, mistakes, panels
from studies.gaps import Gaps
from tauguard.cli import main
from tauguard.report import rate, versions


def payload(rows, processor="P", name="simulation"):
    on = {"processor": processor, "cores": 2, "system": "Linux"}
    what = {"name": name, "quick": True, "seed": 0, "machine": on}
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
    assert sorted(ran) == ["impact", "rigid"]
    collect.collect(tmp_path, ("simulation",), quick=True, seed=1)
    assert ran[-1] == "simulation"


def test_a_process_that_fails_says_why(tmp_path):
    failed = collect.collect(tmp_path, ("nothing",), quick=True, seed=0)
    assert "no study 'nothing'" in failed["nothing"]


def test_the_page_holds_the_studies_the_cases_and_what_is_missing(tmp_path):
    bar = {"study": "summary", "question": "how far", "asked": "1", "measured": "2", "met": False}
    (tmp_path / "simulation.json").write_text(json.dumps(payload([*ROWS, bar])))
    (tmp_path / "endurance.json").write_text(json.dumps(payload([], "another", "endurance")))
    case = {"case": "c", "library": "tauguard", "kind": "scene", "expected": "1", "answer": "2"}
    cases = [case | {"right": False, "why": "hard", "origin": "here", "explained": "soft"}]
    failed = {"rigid": "it broke", "endurance": "stopped"}
    text = bound.bind(tmp_path, cases, failed, Gaps(), "<p>look</p>").read_text()
    for part in ("ideal drive", "rigid (it broke)", "hard", "soft", "Study: simulation", "0 of 1"):
        assert part in text
    for part in ("data:image/svg+xml", "<p>look</p>", "0 of 1 bars", "how far", "P, 2 cores"):
        assert part in text
    assert "another" not in text  # the file of a study that failed now is not shown
    assert "Study: rigid" not in text
    assert not list(tmp_path.glob("*.part"))


def test_rows_become_points_only_with_both_figures():
    (panel,) = panels.panels({"simulation": ROWS}, Gaps())
    assert [(p.label, p.cost, p.error) for p in panel.points] == [
        ("1 ms", 5.0, 1e-4),
        ("2 ms", 5.0, 2e-4),
    ]


def test_convex_methods_are_weighted_by_their_pairs():
    def row(n, wrong):
        return {"study": "table 2.1 static", "auto_ns": 1e3, "auto_wrong": rate(wrong, n)}

    (panel,) = panels.panels({"rigid": [row(10, 1), row(30, 0)]}, Gaps())
    (point,) = panel.points
    assert (point.cost, point.error) == (1.0, pytest.approx(1 / 40))


def test_the_first_table_has_time_and_error_of_both_and_their_ratio():
    row = {"study": "table 2.1 static", "auto_ns": TIME, "auto_wrong": rate(1, 2000)}
    row |= {"coal_net_ns": 2500.0, "coal_wrong": rate(0, 10)}
    (line,) = glance.kernels({"rigid": [row, row]}, Gaps())
    assert line["tauguard takes"] == "5 ns"
    assert line["tauguard's error"] == "2 wrong of 4,000"
    assert (line["peer takes"], line["peer's error"]) == ("2.5 µs", "0 wrong of 20")
    assert line["peer / tauguard"] == "500"
    assert glance.detection({}, Gaps()) == []


def test_false_alarms_of_real_arms_are_those_of_all_their_minutes():
    push = {"study": "pushes", "arm": "a", "state": "moving", "detector": "d", "by chance": 0.1}
    push |= {"found": rate(9, 10), "median delay ms": None}
    free = {"study": "false alarms", "detector": "d", "alarms": 2, "minutes": 3.0}
    (line,) = glance.detection({"real_arm": [push, free, free]}, Gaps())
    assert line["found"].startswith("9 of 10 (0.900 [")
    assert line["false alarms on all arms"] == "4 in 6 min"
    assert line["median delay"] == "-"


def strange(folder):
    """Files under the names of studies that no study wrote: their text, and what is wrong."""
    kinds = {
        "needs": ("", "is no JSON file"),
        "impact": (json.dumps(payload(ROWS))[:200], "is no JSON file"),
        "arms": ("[" * 100_000, "is no JSON file"),
        "cloth": ("[1]", "it holds no object"),
        "guard": (json.dumps(payload(ROWS)), "it says 'simulation'"),
        "faults": (json.dumps({"name": "faults", "rows": 3}), "'quick' is missing"),
        "listen": (json.dumps(payload([1, 2], name="listen")), "a row is no object"),
        "kills": (
            json.dumps(payload(ROWS, name="kills") | {"machine": {"cores": 2}}),
            "'machine' lacks one of",
        ),
    }
    for name, (text, _) in kinds.items():
        (folder / f"{name}.json").write_text(text)
    return kinds


def test_a_file_that_is_no_study_is_named_and_the_rest_is_shown(tmp_path):
    kinds = strange(tmp_path)
    (tmp_path / "mine.json").write_text("{}")
    (tmp_path / "simulation.json").write_text(json.dumps(payload(ROWS[:3])))
    gaps = Gaps()
    page = bound.bind(tmp_path, [], {}, gaps).read_text()
    for name, (_, why) in kinds.items():
        (line,) = [line for line in gaps.lines if line.startswith(f"{name}: {name}.json")]
        assert why in line
        assert escape(line) in page
        assert f"Study: {name}" not in page
    assert len(gaps.lines) == len(kinds)
    assert "not read: mine.json" in page
    assert 'alt="chart of simulation"' in page


def test_a_file_that_is_no_study_is_not_written_over(tmp_path):
    kinds = strange(tmp_path)
    failed = collect.collect(tmp_path, kinds, quick=True, seed=0)
    for name, (text, why) in kinds.items():
        assert why in failed[name]
        assert "move it away" in failed[name]
        assert (tmp_path / f"{name}.json").read_text() == text


def test_rows_of_a_part_of_a_study_cost_their_own_part_of_the_page_only(tmp_path):
    frame_peer = {"study": "frame peer", "ab2pf_ms": 1.0, "scene": "s", "peer_ms": 2.0}
    step = {"study": "step", "what": "the environment", "us_per_action": 5.0}
    parts = {"cloth": [frame_peer | {"peer": "p"}], "environments": [step]}
    for name, rows in parts.items():
        whole = payload(rows, name=name) | ({"incomplete": "Ctrl-C"} if name == "cloth" else {})
        (tmp_path / f"{name}.json").write_text(json.dumps(whole))
    gaps = Gaps()
    page = bound.bind(tmp_path, [], {}, gaps).read_text()
    for line in (
        "cloth: incomplete: Ctrl-C",
        "first tables, cloth, frames: ValueError: no row with method ab2pf, scene s",
        "first tables, environments, steps: ValueError: no row of mujoco.rollout",
        "chart of cloth:",
    ):
        assert any(found.startswith(line) for found in gaps.lines), line
    assert all(escape(line) in page for line in gaps.lines)


def test_what_comes_from_outside_is_escaped(tmp_path):
    evil = "<script>alert(1)</script>\x1b[2J"
    row = {"study": evil, "scene": evil, "us_per_step": TIME, "asked": evil, "measured": evil}
    rows = [*ROWS, row | {"met": False, "question": evil}]
    whole = payload(rows, evil) | {"incomplete": evil, "seed": None}
    (tmp_path / "simulation.json").write_text(json.dumps(whole))
    (tmp_path / "rigid.json").write_text(json.dumps(payload([], name=evil)))
    (tmp_path / f"{evil.replace('/', '')}.json").write_text("{}")
    gaps = Gaps()
    page = bound.bind(tmp_path, [], {"cloth": evil}, gaps).read_text()
    assert "<script" not in page.replace(mistakes.OFFLINE, "")
    assert not any("\x1b" in line for line in gaps.lines)
    assert "&lt;script&gt;" in page


def test_the_command_names_what_it_does_not_show_in_one_line_each(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("tauguard.hard_cases.load_cases", list)
    (tmp_path / "simulation.json").write_text("{")
    with pytest.raises(SystemExit) as stop:
        main(["report", "--out", str(tmp_path), "--bound", "--no-mistakes"])
    said = capsys.readouterr()
    assert stop.value.code == 1
    assert said.err.count("\n") == 1
    assert "simulation.json is no JSON file" in said.err
    assert str(tmp_path / "index.html") in said.out


@pytest.fixture
def made(monkeypatch):
    """How often mistakes were recorded; the recording itself is left out."""
    calls = []

    def judged(folder, seed):
        calls.append(seed)
        folder.mkdir(exist_ok=True)
        (folder / "missed-001.rrd").write_bytes(b"")
        (folder / "missed-001.png").write_bytes(b"picture")
        rows = [{"kind": "missed", "file": "missed-001.rrd", "at [s]": 1.5}]
        return {"counts": "1 missed, 0 late, 0 false alarm", "rows": rows}

    monkeypatch.setattr(mistakes, "judged", judged)
    return calls


def test_mistakes_are_made_once_and_linked(tmp_path, made, capsys):
    folder = tmp_path / "a <b> & c"
    folder.mkdir()
    text = mistakes.mistakes(folder, 3)
    assert capsys.readouterr().out.count("training the detector") == 1
    assert mistakes.mistakes(folder, 3) == text
    assert capsys.readouterr().out == ""
    assert made == [3]
    assert 'href="open/wrong/missed-001.rrd"' in text
    assert escape(f"replay --web '{folder}'") in text
    assert base64.b64encode(b"picture").decode() in text
    assert "no alarm starts in the collision" in text
    assert "<b>" not in text


def test_the_first_of_each_kind_is_drawn_in_the_order_of_the_table(tmp_path):
    kinds = ("missed", "late", "false alarm")
    rows = [
        {"kind": kind, "file": f"{kind}-{k}.rrd", "at [s]": 1.5} for kind in kinds for k in (1, 2)
    ]
    (tmp_path / "wrong").mkdir()
    for row in rows:
        (tmp_path / "wrong" / row["file"].replace("rrd", "png")).write_bytes(row["file"].encode())
    text = mistakes._html(tmp_path, "", rows)
    drawn = re.findall('base64,([^"]+)', text)
    assert [base64.b64decode(one).decode() for one in drawn] == [f"{k}-1.rrd" for k in kinds]


@pytest.mark.parametrize("change", ["build", "seed", "recording", "old form"])
def test_mistakes_of_another_build_seed_or_without_recordings_are_made_again(
    tmp_path, made, capsys, change
):
    mistakes.mistakes(tmp_path, 3)
    kept = json.loads((tmp_path / "wrong.json").read_text())
    if change == "recording":
        (tmp_path / "wrong" / "missed-001.rrd").unlink()
    elif change == "old form":
        del kept["build"]
    else:
        kept[change] = "another" if change == "build" else 4
    (tmp_path / "wrong.json").write_text(json.dumps(kept))
    mistakes.mistakes(tmp_path, 3)
    assert made == [3, 3]


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"seed": 3, "rows": 1, "counts": ""}'])
def test_a_file_of_mistakes_of_somebody_else_is_named_and_kept(tmp_path, made, text):
    (tmp_path / "wrong.json").write_text(text)
    with pytest.raises(ValueError, match="no list of mistakes"):
        mistakes.mistakes(tmp_path, 3)
    assert (tmp_path / "wrong.json").read_text() == text
    assert made == []


def test_an_unknown_study_is_refused(tmp_path, capsys):
    with pytest.raises(SystemExit) as stop:
        main(["report", "--out", str(tmp_path), "--study", "nothing"])
    assert stop.value.code == 2
    assert "there are simulation" in capsys.readouterr().err
