"""The study of real arms: quick runs of its parts."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PEERS = {"momentum observer", "disturbance observer", "sliding mode", "Kalman filter"}


@pytest.fixture
def no_logs(tmp_path, monkeypatch):
    monkeypatch.setenv("TAUGUARD_DATA", str(tmp_path))


@pytest.mark.usefixtures("no_logs")
def test_it_says_so_where_there_are_no_logs(bench):
    file, said = bench("real_arm")
    assert len(file["rows"]) == 1
    assert "no logs: set TAUGUARD_DATA to their folder" in said


@pytest.fixture
def two_arms(tmp_path, monkeypatch, data_dir):
    """The logs of two arms are a fourth of the work of all."""
    for name in ("ur5", "panda_touch"):
        (tmp_path / name).symlink_to(data_dir / name)
    monkeypatch.setenv("TAUGUARD_DATA", str(tmp_path))


@pytest.mark.data
@pytest.mark.usefixtures("two_arms")
def test_pushes_of_real_arms_are_found_beside_public_observers(bench):
    file, _ = bench("real_arm")
    pushes = [row for row in file["rows"] if row["study"] == "pushes" and row["arm"] == "ur5"]
    moving = {row["detector"]: row for row in pushes if row["state"] == "moving"}
    assert set(moving) == {"ours", *PEERS}
    assert moving["ours"]["found"]["n"] == 11
    assert moving["ours"]["found"]["value"] > moving["ours"]["by chance"]
    touches = {row["detector"] for row in file["rows"] if row["arm"] == "panda_touch"}
    assert {"ours", "Franka's estimate", "Franka's estimate, 12 to 20 N m"} < touches


SETTLES = """
import numpy as np
from studies.real_arms.observers import PEERS
from tauguard.detectors import ArmModel
from tauguard.detectors.dynamics.robot import inverse_dynamics
from tests.detectors.synthetic_arm import nominal, record
trace, added = record(3, seconds=6.0), np.array([6.0, -4.0, 2.0])
qdd = np.gradient(trace.qd, trace.t, axis=0)
tau = inverse_dynamics(nominal(), trace.q, trace.qd, qdd)
for name, peer in PEERS.items():
    found = peer(ArmModel(nominal(), np.ones(3)), trace, tau - added)[trace.t > 3.0]
    off = np.abs(np.median(found, axis=0) - added)
    # At 100 Hz the torque of the motion is known to some percent.
    assert (off < 0.05 * np.abs(tau).max(axis=0) + 0.1).all(), (name, off)
    print(name)
"""


def test_public_observers_settle_on_an_added_torque():
    done = subprocess.run(
        [sys.executable, "-c", SETTLES], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) == 4


@pytest.mark.data
def test_force_stands_beside_the_sensor(bench, data_dir):
    file, _ = bench("real_arms-force")
    force = [row for row in file["rows"] if row["study"] == "force"]
    assert len(force) >= 4
    assert all(row["low N"] <= row["found N"] <= row["high N"] for row in force)
    errors = {row["of"]: row for row in file["rows"] if row["study"] == "errors"}
    assert errors["peak"]["interval holds"] >= 0.7 * errors["peak"]["rows"]
