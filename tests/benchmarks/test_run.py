"""What a failing study leaves: rows, one line, and the right exit code."""

import json
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from tauguard.benchmarks import STUDIES, Study
from tauguard.benchmarks.harness import Incomplete
from tauguard.cli import main


def failing(monkeypatch, run):
    module = SimpleNamespace(run=run, draw=lambda rows, figure: None)
    monkeypatch.setitem(sys.modules, "tauguard.benchmarks.failing", module)
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
