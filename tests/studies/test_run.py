"""What a failing study leaves: rows, one line, and the right exit code."""

import json
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from studies import STUDIES, Study
from studies.harness import Incomplete
from tauguard.cli import main


def failing(monkeypatch, run):
    module = SimpleNamespace(run=run, draw=lambda rows, figure: None)
    monkeypatch.setitem(sys.modules, "studies.failing", module)
    monkeypatch.setitem(STUDIES, "failing", Study("failing", "fails"))


def bench(tmp_path, *more):
    files = ["--json", str(tmp_path / "f.json"), "--figure", str(tmp_path / "f.png")]
    main(["bench", "failing", *files, *more])


def test_a_librarys_error_is_a_defect_and_not_bad_input(monkeypatch, tmp_path, capsys):
    failing(monkeypatch, lambda quick, seed: np.zeros(0).max())
    with pytest.raises(SystemExit) as stop:
        bench(tmp_path)
    assert stop.value.code == 1
    said = capsys.readouterr().err
    assert "a defect of tauguard" in said
    assert "zero-size array" in said
    assert said.count("\n") == 1
    with pytest.raises(RuntimeError, match="zero-size"):
        bench(tmp_path, "--debug")


def test_bad_input_is_told_in_one_line(monkeypatch, tmp_path, capsys):
    from tauguard.detectors import make_detector

    failing(monkeypatch, lambda quick, seed: make_detector("nothing"))
    with pytest.raises(SystemExit) as stop:
        bench(tmp_path)
    assert stop.value.code == 2
    assert "no detector 'nothing'" in capsys.readouterr().err


def test_what_was_found_is_printed_and_written(monkeypatch, tmp_path, capsys):
    def run(quick, seed):
        raise Incomplete([{"study": "a", "figure": 42}], {"b": ZeroDivisionError("by nought")})

    failing(monkeypatch, run)
    with pytest.raises(SystemExit) as stop:
        bench(tmp_path)
    assert stop.value.code == 1
    told = capsys.readouterr()
    assert "42" in told.out
    assert "b: ZeroDivisionError: by nought" in told.err
    written = json.loads((tmp_path / "f.json").read_text())
    assert written["rows"] == [{"study": "a", "figure": 42}]
    assert "by nought" in written["incomplete"]


@pytest.mark.parametrize(("typed", "meant"), [("gard", "guard"), ("detecton", "detection")])
def test_a_misspelt_study_is_answered_with_the_nearest(capsys, typed, meant):
    with pytest.raises(SystemExit):
        main(["bench", typed])
    said = capsys.readouterr().err
    assert f"no study {typed!r}: did you mean {meant}?" in said
    assert said.count("\n") == 1


@pytest.mark.parametrize("load", [0.5, 50.0])
def test_times_come_with_the_load_of_the_machine(monkeypatch, tmp_path, capsys, load):
    monkeypatch.setattr("os.getloadavg", lambda: (load, load, load))
    failing(monkeypatch, lambda quick, seed: [{"study": "a", "over_plain": 158.0}])
    bench(tmp_path)
    said = capsys.readouterr().out
    assert f"load: {load} before, {load} after" in said
    assert ("do not trust" in said) == (load == 50.0)
    assert json.loads((tmp_path / "f.json").read_text())["machine"]["load"] == load


@pytest.mark.parametrize("flag", ["--json", "--figure"])
def test_a_folder_that_is_not_there_is_named_before_the_study_runs(
    monkeypatch, tmp_path, capsys, flag
):
    ran = []
    failing(monkeypatch, lambda quick, seed: ran.append(1))
    with pytest.raises(SystemExit):
        bench(tmp_path, flag, str(tmp_path / "none" / "f.png"))
    assert "none; make it first" in capsys.readouterr().err
    assert not ran
