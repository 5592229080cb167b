"""The examples run and show what they say."""

import math
import runpy
from pathlib import Path


def test_convex_overlap(capsys):
    runpy.run_path(str(Path(__file__).parents[2] / "examples" / "convex_overlap.py"))
    shown = capsys.readouterr().out
    assert "from 0.2: time of impact 0.400, normal [0. 0. 1.]" in shown
    assert "frame 2: 2 hits, 2 answered" in shown


def test_meshes_in_motion(capsys):
    runpy.run_path(str(Path(__file__).parents[2] / "examples" / "meshes_in_motion.py"))
    shown = capsys.readouterr().out
    assert "hit [ True  True False]" in shown
    assert "straight: time of impact 0.200 at [0.1 0.  0. ]" in shown
    # The rod's lower edge at its end comes down to the block's top at half height 0.1.
    angle = 0.6 * 0.481022
    height = 0.3 - 0.1 * 0.481022 - 0.5 * math.sin(angle) - 0.01 * math.cos(angle)
    assert abs(height - 0.1) < 1e-6
    assert (
        "swinging: time of impact 0.481022 at [0.0765 0.     0.1   ], normal [ 0.  0. -1.]" in shown
    )
