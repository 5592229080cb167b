"""The learning example learns: targets that nobody reached at first."""

import importlib.util
from pathlib import Path

SOURCE = Path(__file__).parents[2] / "examples" / "learn_reach.py"


def test_the_cross_entropy_method_reaches_targets():
    spec = importlib.util.spec_from_file_location("learn_reach", SOURCE)
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    weights, curve = example.learn(generations=7, population=16, steps=200, seed=0)
    assert weights.shape == (6, 3)
    assert curve[0, 1] == 0
    assert curve[-2:, 1].mean() >= 0.5  # targets an episode of two seconds
    assert curve[-2:, 0].mean() > curve[0, 0] + 0.3
