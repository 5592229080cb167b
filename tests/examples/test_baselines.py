"""Standing still is never a success, hurry is punished, and care is rewarded."""

import importlib.util
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "examples" / "baselines.py"
SPEC = importlib.util.spec_from_file_location("baselines", SOURCE)
BASELINES = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(BASELINES)
#: Seeds that nothing was developed on.
FIRST = 70_000


@pytest.mark.parametrize("task", BASELINES.TASKS)
def test_standing_still_does_not_succeed(task):
    assert BASELINES.play(task, "zero", 3, FIRST)[:, 0].sum() == 0


def test_the_path_of_react_is_for_the_gentle():
    gentle = BASELINES.play("React-v1", "straight, gentle", 8, FIRST)
    fast = BASELINES.play("React-v1", "straight, fast", 8, FIRST)
    assert gentle[:, 0].mean() >= 0.8
    assert fast[:, 0].mean() <= 0.2
    assert gentle[:, 3].max() < 1 < fast[:, 3].max()  # force over its limit
    assert gentle[:, 2].mean() > fast[:, 2].mean() + 1


@pytest.mark.parametrize("task", ["ClothReach-v1", "TwoArms-v1"])
def test_straight_paths_touch(task):
    rows = BASELINES.play(task, "straight, fast", 4, FIRST)
    assert rows[:, 1].mean() > 1
    assert rows[:, 4].mean() >= 0.5
