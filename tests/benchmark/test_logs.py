"""Logs with their contacts, and how alarms on them are counted."""

import dataclasses
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import tauguard as tg
from tauguard.benchmark.arms import ARMS, judged_logs
from tauguard.benchmark.judging import COLUMNS, JudgedLog, as_csv, count_log, table_rows
from tauguard.detectors.evaluation.matching import Contact
from tauguard.findings import ArgumentError, FileError
from tauguard.traces import Alarm, Trace
from tauguard.traces.logs import Log

ROOT = Path(__file__).resolve().parents[2]


def log(seconds=20.0, name="a"):
    t = 100.0 + np.arange(round(seconds * 100) + 1) / 100
    zeros = np.zeros((len(t), 1))
    return Log(Trace(("j",), t, zeros, zeros, zeros), name=name)


def alarms(*starts):
    return [Alarm(100.0 + s, 100.04 + s) for s in starts]


def test_rows_of_a_log_that_was_counted_by_hand():
    contacts = [Contact(105.0, 105.2, "switch"), Contact(110.0, 110.3, "switch", True)]
    counted = count_log(log(), contacts, alarms(0.2, 2.0, 5.12, 5.9, 15.0))
    free = count_log(log(name="b"), (), alarms(3.0))
    rows = table_rows("m", "p", [JudgedLog("ur5", "a", counted), JudgedLog("ur5", "b", free)])
    moving, standing = rows
    assert (moving["state"], moving["found"], moving["contacts"]) == ("moving", "0", "1")
    assert (standing["found"], standing["low"], standing["high"]) == ("1", "0.207", "1.000")
    assert [standing[f"within {ms} ms"] for ms in (100, 150, 250)] == ["0", "1", "1"]
    # 19.5 s twice, less from 4.95 to 6.2 s and from 9.95 to 11.3 s; 5.9 s is a repeat.
    assert standing["free min"] == f"{(39 - 1.25 - 1.35) / 60:.2f}"
    assert standing["false alarms"] == "3"


def test_contacts_that_are_seen_by_eye_have_no_delays_and_leave_no_free_time():
    counted = count_log(log(), [Contact(105.0, 105.2, "by eye")], alarms(2.0, 5.1))
    (row,) = table_rows("m", "p", [JudgedLog("ur5", "a", counted)])
    assert (row["found"], row["within 100 ms"], row["false alarms"]) == ("1", "", "")
    assert as_csv([row]).splitlines()[0] == ",".join(COLUMNS)


def test_an_arm_without_logs_says_how_to_get_them(tmp_path, monkeypatch):
    monkeypatch.setenv("TAUGUARD_DATA", str(tmp_path))
    with pytest.raises(FileError, match="tauguard data fetch ur5"):
        next(iter(tg.benchmark.logs("ur5")))
    with pytest.raises(ArgumentError, match="no arm 'ur6'"):
        next(iter(tg.benchmark.logs("ur6")))


@pytest.mark.data
def test_every_log_comes_with_its_contacts(data_dir, monkeypatch):
    monkeypatch.setenv("TAUGUARD_DATA", str(data_dir))
    found = {log.name: contacts for log, contacts in tg.benchmark.logs("ur5")}
    assert [len(found[n]) for n in ("no2", "no5_pushed", "no7_pushed")] == [0, 10, 5]
    assert {c.truth for c in found["no10_standing_force"]} == {"sensor"}
    assert len(found["no10_standing_force"]) == 8
    touches = [contacts for _, contacts in tg.benchmark.logs("panda_touch")]
    assert sum(map(len, touches)) == 122
    assert len(list(judged_logs("ur10e"))) == 15


@pytest.mark.data
def test_the_script_prints_the_table_of_contacts(data_dir):
    command = [sys.executable, "-m", "studies.real_arms.onsets"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True,
                          env={"TAUGUARD_DATA": str(data_dir), "PATH": ""})  # fmt: skip
    assert done.stdout == (ROOT / "benchmark" / "contacts.csv").read_text()


@pytest.mark.data
def test_logs_of_a_blind_arm_are_judged_by_the_same_code(data_dir, tmp_path, monkeypatch):
    """Copies of logs that are known, under names of the blind ones."""
    monkeypatch.setenv("TAUGUARD_DATA", str(tmp_path))
    for source, target in {
        "ur5/ur5.urdf": "ur5/ur5.urdf",
        "ur5/free/no5.csv": "ur5_blind/Movement_No1.csv",
        "ur5/contact/no10_standing_force.csv": "ur5_blind/Movement_No10_ForceSensor_All.csv",
    }.items():
        (tmp_path / target).parent.mkdir(exist_ok=True)
        (tmp_path / target).symlink_to(data_dir / source)
    (free, none), (_, contacts) = judged_logs("ur5_blind")
    assert none == ()
    assert free.name == "Movement_No1"
    assert len(contacts) == 8
    assert ARMS["ur5_blind"].blind
    assert ARMS["ur5_blind"].trained_on == "ur5"
    assert dataclasses.replace(contacts[0], onset=0.0).truth == "sensor"
