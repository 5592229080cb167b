"""The example of convex bodies runs and shows what it says."""

import runpy
from pathlib import Path


def test_convex_overlap(capsys):
    runpy.run_path(str(Path(__file__).parents[2] / "examples" / "convex_overlap.py"))
    shown = capsys.readouterr().out
    assert "from 0.2: toi 0.400, normal [0. 0. 1.]" in shown
    assert "frame 2: 2 hits, 2 answered" in shown
