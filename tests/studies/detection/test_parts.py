"""The study of parts: every form lacks what its name says, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from studies.detection import arm_scores, parts
from studies.detection.fleet import Training
from tauguard.detectors import SrqSvr
from tauguard.detectors.calibration.nominal import nominal_design
from tauguard.report import table


@pytest.fixture(scope="module")
def slices():
    return Training(slices=2, collisions=2, free=2, free_seconds=10.0).traces(0, 5)


def test_estimators_lack_what_is_left_out(slices):
    found = {n: f.front.fit(slices, nominal_design()) for n, f in parts.forms().items()}
    plain = found[parts.WHOLE]
    trace = slices[-1]
    whole = plain.estimate(trace).unexplained
    for name in parts.UNKNOWNS:
        front = found[name]
        assert isinstance(front, parts.PartialFrontEnd)
        assert front.arm.drive_gain.tolist() == plain.arm.drive_gain.tolist()
        assert not np.allclose(front.estimate(trace).unexplained, whole)
    constant = found["envelope over the speed"].arm.envelope
    assert (constant.weights[:, 1:] == 0).all()
    assert (constant.weights[:, 0] > 0).all()
    assert parts.forms()[parts.WHOLE] == SrqSvr()


def test_a_small_run_prints_a_row_for_every_part(monkeypatch, tmp_path):
    names = (parts.WHOLE, "torque offsets")
    few = {name: replace(parts.forms()[name], windows=300, mined=0) for name in names}
    monkeypatch.setattr(parts, "forms", lambda: few)
    monkeypatch.setattr(parts, "Workers", lambda: parts_in_place())
    monkeypatch.setattr(parts, "TIMED", 200)
    monkeypatch.setattr(arm_scores, "SPEEDS", (60.0,))  # an episode of a minute each
    little = Training(slices=2, collisions=2, free=2, free_seconds=8.0)
    extent = replace(parts.QUICK.extent, names=names, training=little, calibration_hours=0.001)
    size = replace(parts.QUICK, extent=replace(extent, hours=0.001))
    monkeypatch.setattr(parts, "QUICK", size)
    rows = parts.measure(True, 0, str(tmp_path))
    assert [row["without"] for row in rows] == [*names, parts.LEVELS]
    times = [row["time"] for row in rows]
    assert times[0]["median"] == 1.0
    assert all(0 < one["low"] <= one["median"] <= one["high"] for one in times[:-1])
    assert times[-1] is None
    assert "torque offsets" in table(rows, notes=parts.NOTES)
    figure = pytest.importorskip("matplotlib.figure").Figure()
    parts.draw(rows, figure)


def parts_in_place():
    from studies.framework import Workers

    return Workers(1)
