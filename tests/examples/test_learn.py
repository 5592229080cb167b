"""The learning example learns: targets that nobody reached at first."""

import importlib.util
import runpy
from pathlib import Path

import numpy as np
import pytest

from tauguard.traces import read_mcap

SOURCE = Path(__file__).parents[2] / "examples" / "learn_reach.py"


def test_the_cross_entropy_method_reaches_targets(tmp_path):
    spec = importlib.util.spec_from_file_location("learn_reach", SOURCE)
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    example.EPISODES = 2
    weights, curve = example.learn(generations=7, population=20, steps=180, seed=0)
    assert weights.shape == (6, 3)
    assert curve[0, 1] == 0
    assert curve[-2:, 1].mean() >= 0.5  # targets an episode of two seconds
    assert curve[-2:, 0].mean() > curve[0, 0] + 0.3
    path, _, worst = example.record(weights, tmp_path, steps=50)
    assert len(read_mcap(path)[0].t) == 500
    assert worst >= 0


def test_a_budget_ranks_those_who_keep_it_first():
    example = runpy.run_path(str(SOURCE.with_name("learn_safely.py")))
    value, cost = np.array([3.0, 2.0, 1.0, 0.0]), np.array([90.0, 5.0, 0.0, 30.0])
    ranked = example["ranked"]
    assert ranked(value, cost, None).tolist() == [0, 1, 2, 3]
    assert ranked(value, cost, 10.0).tolist()[:2] == [1, 2]
    assert ranked(value, cost + 100, 10.0).tolist() == [2, 1, 3, 0]
    still = np.append(np.zeros(36), -3.0)
    rows = example["compare"]([still, still], episodes=1, steps=10)
    assert rows[0] == rows[1]
    assert rows[0]["targets"] == 0


def test_stable_baselines_trains(monkeypatch, capsys):
    pytest.importorskip("stable_baselines3", reason="the extra `learn` is not installed")
    source = SOURCE.with_name("learn_sb3.py")
    monkeypatch.setattr("sys.argv", [source.name, "--steps", "4096"])
    runpy.run_path(str(source), run_name="__main__")
    assert "mean return of one more episode" in capsys.readouterr().out
