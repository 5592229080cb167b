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
    assert len(read_mcap(path).t) == 500
    assert worst >= 0


def test_ppo_learns_and_its_policy_is_the_one_that_was_trained(tmp_path):
    pytest.importorskip("stable_baselines3", reason="the extra `learn` is not installed")
    example = runpy.run_path(str(SOURCE.with_name("learn.py")))
    policy, price, _ = example["train"]("React-v1", steps=4096, copies=4, payload_g=100)
    assert price == 0
    assert policy(np.zeros(30)).shape == (6,)
    assert policy.environment["id"] == "tauguard:tauguard/React-v1"
    assert policy.environment["payload_g"] == 100
    policy.save(tmp_path / "policy.npz")
    again, _, _ = example["train"]("React-v1", steps=64, copies=1, start=tmp_path / "policy.npz")
    seen = np.random.default_rng(0).normal(size=30)
    assert again(seen) == pytest.approx(policy(seen), abs=0.3)
    start = SOURCE.with_name("policies") / "TwoArms-v1.npz"  # its arms meet
    _, dear, cost = example["train"]("TwoArms-v1", budget=1e-6, steps=4096, copies=4, start=start)
    assert dear > 0.25  # it grows by .1 a round, and at most one round of four keeps the budget
    assert cost > 0
