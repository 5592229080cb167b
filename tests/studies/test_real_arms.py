"""The study of real arms: quick runs of its parts."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def no_logs(tmp_path, monkeypatch):
    monkeypatch.setenv("TAUGUARD_DATA", str(tmp_path))


@pytest.mark.usefixtures("no_logs")
def test_it_says_so_where_there_are_no_logs(bench):
    file, said = bench("real_arm")
    assert len(file["rows"]) == 1
    assert "no logs: run `tauguard data fetch all`" in said


@pytest.fixture
def one_arm(tmp_path, monkeypatch, data_dir):
    """Two of the UR5's collision-free logs, and one with contacts."""
    (tmp_path / "ur5" / "free").mkdir(parents=True)
    (tmp_path / "ur5" / "contact").mkdir()
    for name in (
        "ur5.urdf",
        "free/no6.csv",
        "free/no7.csv",
        "contact/no5_pushed.csv",
    ):
        (tmp_path / "ur5" / name).symlink_to(data_dir / "ur5" / name)
    monkeypatch.setenv("TAUGUARD_DATA", str(tmp_path))


@pytest.mark.data
@pytest.mark.usefixtures("one_arm")
def test_a_detector_of_ones_own_is_ranked_beside_the_table(bench, tmp_path):
    (tmp_path / "mine.py").write_text(OWN)
    file, _ = bench("real_arms-table", "--detector", "mine:Torque")
    rows = [row for row in file["rows"] if row["study"] == "table"]
    assert {row["operating point"] for row in rows} >= {"as it is", "60 an hour", "12 an hour"}
    moving = [row for row in rows if row["state"] == "moving"]
    assert {row["contacts"] for row in moving} == {"9"}
    ranked = [row["method"] for row in file["rows"] if row["study"] == "rank"]
    assert {"mine:Torque", "tauguard free-motion", "knows nothing"} <= set(ranked)


@pytest.mark.data
@pytest.mark.usefixtures("one_arm")
def test_a_calibration_explains_more_than_the_robot_file(bench):
    file, _ = bench("real_arms-identification")
    error = {row["tool"]: row.get("error") for row in file["rows"]}
    assert error["tauguard"] < 0.8 * error["robot file"]


OWN = """
import numpy as np

class Torque:
    name = "torque"
    def fit(self, traces, arm):
        self.limit = np.max([np.abs(np.diff(t.current, axis=0)).max(0) for t in traces], axis=0)
        return self
    def scores(self, trace):
        change = np.abs(np.diff(trace.current, axis=0, prepend=trace.current[:1]))
        return (change / self.limit).max(axis=1)
"""


SETTLES = """
import numpy as np
from studies.real_arms.observers import OBSERVERS
from tauguard.detectors import ArmModel
from tauguard.detectors.dynamics.robot import inverse_dynamics
from tests.detectors.synthetic_arm import nominal, record
trace, added = record(3, seconds=6.0), np.array([6.0, -4.0, 2.0])
qdd = np.gradient(trace.qd, trace.t, axis=0)
tau = inverse_dynamics(nominal(), trace.q, trace.qd, qdd)
for name, peer in OBSERVERS.items():
    found = peer(ArmModel(nominal(), np.ones(3)), trace, tau - added, 30.0)[trace.t > 3.0]
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
