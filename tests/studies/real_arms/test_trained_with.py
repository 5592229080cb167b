"""Trained with little: what the rows say."""

from types import SimpleNamespace

import numpy as np
import pytest

from studies.real_arms import trained_with
from studies.real_arms.smallest_push import smallest_pushes
from studies.real_arms.trained_with import first_seconds
from tauguard.detectors import ArmModel
from tauguard.detectors.calibration.recording import Load, Recording
from tauguard.detectors.methods.free_motion import FreeMotion
from tests.detectors.synthetic_arm import GAIN, nominal, record


@pytest.fixture(scope="module")
def fitted():
    return FreeMotion().fit([record(1, seconds=30.0)], ArmModel(nominal(), GAIN)).carrying(Load())


def test_training_takes_logs_up_to_the_seconds():
    logs = [Recording(record(seed, seconds=10.0)) for seed in range(3)]
    kept = first_seconds(logs, 14.0, np.random.default_rng(0))
    lengths = [float(r.trace.t[-1] - r.trace.t[0]) for r in kept]
    assert sum(lengths) == pytest.approx(14.0, abs=0.05)
    whole = first_seconds(logs, 10.0, np.random.default_rng(0))
    assert all(len(r.trace.t) > 100 for r in whole)
    assert len(first_seconds(logs, np.inf, np.random.default_rng(0))) == 3


def test_a_smaller_bound_finds_a_smaller_push(fitted):
    trace = record(7, dwell=(6.0, 20.0))
    rng = np.random.default_rng(0)
    standing = smallest_pushes(fitted, trace, False, 4, rng)
    moving = smallest_pushes(fitted, record(8), True, 4, rng)
    assert len(standing) == len(moving) == 4
    assert 0 < np.median(standing) < np.median(moving) < np.inf


def test_a_log_without_such_moments_has_no_pushes(fitted):
    trace = record(8, dwell=(30.0, 31.0))
    assert smallest_pushes(fitted, trace, False, 3, np.random.default_rng(0)) == []


@pytest.mark.parametrize(("quick", "rows"), [(True, 2), (False, 3 * (2 + trained_with.ARMS))])
def test_a_quick_run_has_one_real_and_one_simulated_arm(monkeypatch, quick, rows):
    arms = [SimpleNamespace(name=name, free=()) for name in ("first", "second")]
    monkeypatch.setattr(trained_with, "available", lambda: arms)
    monkeypatch.setattr(trained_with, "nominal", lambda arm: None)
    monkeypatch.setattr(trained_with, "recordings", lambda arm, kinds: {})
    monkeypatch.setattr(trained_with, "drawn_arm", lambda number, logs: (None, {}))
    monkeypatch.setattr(trained_with, "_row", lambda name, *_: {"arm": name})
    found = [row["arm"] for row in trained_with.rows(quick, 0)]
    assert len(found) == rows
    assert found[0] == "first"
    assert "simulated 100" in found
