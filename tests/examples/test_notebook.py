"""The notebook of the gallery: its contacts are found, and its stream is its log."""

import runpy
from pathlib import Path

import matplotlib
import numpy as np
import pytest

FILE = Path(__file__).resolve().parents[2] / "examples" / "gallery" / "plot_17_notebook.py"


def test_from_free_logs_to_alarms(capsys):
    matplotlib.use("Agg")
    names = runpy.run_path(str(FILE))
    found, arm = names["found"], names["arm"]
    times = [alarm.start for alarm in found.alarms]
    assert times == [pytest.approx(plan.time, abs=0.2) for plan in names["contacts"]]
    first = found.signals.t[np.argmax(found.detection.alarm)]
    assert names["t"] == first
    assert f"{first:.3f} s: collision" in (out := capsys.readouterr().out)
    assert "error [order]: the currents of joint2 and joint3 seem exchanged" in out
    assert names["arm_of_logs"].seed == 5
    assert all((rms < 2.0).all() for rms in arm.held_out.values())
