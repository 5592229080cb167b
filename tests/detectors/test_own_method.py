"""The page's method of one's own: trained, saved, streamed and named as ours are."""

import importlib
import re
from pathlib import Path

import numpy as np
import pytest

from tauguard.cli import main
from tauguard.datasets import free_episodes, struck_episodes, write_dataset
from tauguard.detectors import load_model, make_detector, registry, save_model
from tauguard.detectors.alarms.training import with_rate

PAGE = Path(__file__).resolve().parents[2] / "docs" / "howto" / "own_detector.md"


@pytest.fixture
def mypackage(tmp_path, monkeypatch):
    block = re.search(r"^```python file=mypackage.py\n(.*?)^```", PAGE.read_text(), re.S | re.M)
    lines = [line for line in block[1].splitlines() if line.strip()]
    assert len(lines) < 30
    (tmp_path / "mypackage.py").write_text(block[1])
    monkeypatch.syspath_prepend(tmp_path)
    yield importlib.import_module("mypackage")
    monkeypatch.delitem(importlib.sys.modules, "mypackage")


def test_it_streams_and_gets_a_threshold(mypackage, training, unseen, arm):
    fitted = make_detector("mypackage:CurrentSize").fit(training, arm)
    object.__setattr__(fitted, "floor", 2.0)  # a name that means something else to them
    alarm, trace = with_rate(fitted, training, 10.0), unseen[0]
    stream, whole = alarm.stream(), alarm.detect(trace)
    up = [stream.step(*row) for row in zip(trace.q, trace.qd, trace.current, strict=True)]
    np.testing.assert_array_equal(up, whole.alarm)


def test_the_command_line_trains_and_evaluates_it(mypackage, tmp_path, capsys):
    episodes = struck_episodes(5, 1, 3, (30.0,)) + free_episodes(5, 2, 8.0, (30.0,))
    write_dataset(episodes, tmp_path / "traces", workers=1)
    folder, model = str(tmp_path / "traces"), str(tmp_path / "own.tauguard")
    own = ("--detector", "mypackage:CurrentSize", "--model", model)
    main(["train", "--traces", folder, *own])
    main(["evaluate", "--traces", folder, *own])
    assert "sensitivity from 16 N m up" in capsys.readouterr().out
    assert load_model(model).detector.name == "current-size"


def test_the_environment_names_its_module_for_every_command(
    mypackage, training, arm, tmp_path, monkeypatch
):
    path = tmp_path / "own.tauguard"
    save_model(
        with_rate(make_detector("mypackage:CurrentSize").fit(training, arm), training, 10.0), path
    )
    monkeypatch.setattr(registry, "_NAMED", set())
    with pytest.raises(ValueError, match="export TAUGUARD_DETECTORS=mypackage"):
        load_model(path)
    monkeypatch.setenv("TAUGUARD_DETECTORS", "another,mypackage")
    assert load_model(path).detector.name == "current-size"
