"""The bin-picking example: the arm carries its part, and touches nothing but the person."""

import importlib.util
from pathlib import Path

SOURCE = Path(__file__).parents[2] / "examples" / "bin_picking.py"


def test_the_example_moves_between_bin_and_person(capsys):
    spec = importlib.util.spec_from_file_location("bin_picking", SOURCE)
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    worst = example.main(seconds=3.0)
    assert {"bin", "loose_part", "cart"} < worst.keys()
    assert "held_part" not in worst
    assert worst["bin"] == worst["loose_part"] == worst["cart"] == 0
    assert "cost" in capsys.readouterr().out
