"""The command line as a user meets it: help, one-line errors, and the whole way."""

import dataclasses
import json
import os
import re
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from tauguard import Detector, evaluate
from tauguard.cli import COMMANDS, main
from tauguard.cli.replay import newest
from tauguard.traces import Detection, Trace, Truth


def run(*args: str) -> None:
    main(list(args))


def fails(capsys, *args: str) -> str:
    """Runs a command that must end in exit code 2 with one line; returns the line."""
    with pytest.raises(SystemExit) as stop:
        run(*args)
    assert stop.value.code == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    return line


def test_help_is_quick_and_names_every_command():
    command = [sys.executable, "-m", "tauguard", "--help"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        shown = process.stdout.read()
        # Its own processor time: others may be busy, and other children may end meanwhile.
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0
    assert used.ru_utime < 1.0
    for name in COMMANDS:
        assert name in shown


def test_a_flag_that_is_given_twice_is_refused(capsys):
    line = fails(capsys, "calibrate", "free", "--payload", "a.csv=1", "--payload", "b.csv=2")
    assert "--payload is given twice" in line
    assert "--payload A B" in line


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_every_command_explains_itself(name, capfd):
    with pytest.raises(SystemExit) as stop:
        run(name, "--help")
    assert stop.value.code == 0
    shown = capfd.readouterr().out  # bench and report print in a process of their own
    assert f"tauguard {name}" in shown
    plain = " ".join(shown.replace("│", " ").split())
    assert not re.search(r"\(default: [^)]*\)\.? \(default:", plain)
    assert "(default: None)" not in plain


def test_an_unknown_command_names_the_nearest(capsys):
    assert "did you mean demo?" in fails(capsys, "dmeo")


def test_bad_input_is_one_line(capsys, tmp_path):
    assert "no such folder" in fails(capsys, "train", "--traces", str(tmp_path / "none"))
    assert "no .mcap files" in fails(capsys, "train", "--traces", str(tmp_path))
    (tmp_path / "a.mcap").write_bytes(b"not a recording")
    assert "a.mcap" in fails(capsys, "train", "--traces", str(tmp_path))
    missing = str(tmp_path / "m.tauguard")
    line = fails(capsys, "evaluate", "--traces", str(tmp_path), "--model", missing)
    assert "m.tauguard" in line
    line = fails(capsys, "simulate", "--out", str(tmp_path / "o"), "--episodes", "0")
    assert "expected 1 or more" in line
    (tmp_path / "file").touch()
    assert "simulate" in fails(capsys, "simulate", "--out", str(tmp_path / "file"))


def test_what_replay_cannot_show_is_said(capsys, tmp_path):
    assert "no index.html in it" in fails(capsys, "replay", str(tmp_path))
    assert "no such file" in fails(capsys, "replay", str(tmp_path / "none.rrd"))


def test_of_a_folder_of_recordings_the_newest_is_shown(tmp_path, capsys):
    for name, time in (("b/a.mcap", 5), ("c.mcap", 9), ("a.mcap", 7)):
        file = tmp_path / name
        file.parent.mkdir(exist_ok=True)
        file.touch()
        os.utime(file, (time, time))
    assert newest(tmp_path) == tmp_path / "c.mcap"
    assert "3 recordings; showing the newest, c.mcap" in capsys.readouterr().out
    (tmp_path / "index.html").touch()
    assert newest(tmp_path) == tmp_path


def test_replay_replaces_no_recording(capsys, tmp_path):
    """A file that nobody named is not written over, nor shown for a newer or a missing log."""
    (tmp_path / "a.rrd").write_bytes(b"mine")
    (tmp_path / "a.mcap").touch()
    os.utime(tmp_path / "a.rrd", (1, 1))
    for flags in ([], ["--web"]):
        message = fails(capsys, "replay", str(tmp_path / "a.mcap"), *flags)
        assert "a.rrd is there already: name the file to write with --out" in message
    assert (tmp_path / "a.rrd").read_bytes() == b"mine"


def test_simulate_train_evaluate(tmp_path, capsys):
    struck = tmp_path / "all"
    common = ("--workers", "1", "--payloads-g", "0", "1000", "--speeds", "30")
    flags = ("--episodes", "2", "--collisions", "5", "--free", "2", "--seconds", "40")
    run("simulate", "--out", str(struck), *flags, *common)
    assert len(list(struck.glob("free-*.mcap"))) == 2
    model, figures = tmp_path / "model.tauguard", tmp_path / "figures.json"
    run("train", "--traces", str(struck), "--model", str(model))
    flags = ("--json", str(figures), "--figure", str(tmp_path / "f.png"))
    run("evaluate", "--traces", str(struck), "--model", str(model), *flags)
    row = json.loads(figures.read_text())["rows"][0]
    assert 8 <= row["confusion"]["tp"] + row["confusion"]["fn"] <= 10
    # Judged on what it was trained on: blows from 16 N m up are not missed.
    assert row["headline"]["sensitivity"]["value"] > 0.8
    assert (tmp_path / "f.png").stat().st_size > 10_000
    said = row["diagnosis"]
    assert said["link_right"]["n"] == row["confusion"]["tp"]
    assert said["link_right"]["value"] >= said["last_joint_right"]["low"]
    assert 0 < said["point_cm"]["median"] < 60
    out = capsys.readouterr().out
    assert "sensitivity from 16 N m up" in out
    assert "link or its neighbour" in out
    for path in sorted(struck.iterdir())[1:]:  # each event is drawn: one recording is enough
        path.unlink()
    flags = ("--events", str(tmp_path / "wrong"), "--late", "0.001")
    run("evaluate", "--traces", str(struck), "--model", str(model), *flags)
    page = (tmp_path / "wrong" / "index.html").read_text()
    assert f"<td>{next(struck.iterdir()).name}</td>" in page  # the file, not a number of our own


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"joint_names": ("a", "b")}, "^second.mcap has joints a, b, the model j1, j2"),
        ({"t": np.arange(50) / 100}, "^second.mcap"),
    ],
)
def test_a_recording_that_does_not_fit_is_named_by_its_file(change, said):
    t, still = np.arange(50) / 1000, np.zeros((50, 2))
    first = Trace(("j1", "j2"), t, still, still, still, truth=quiet(t), meta={"log": "first.mcap"})
    second = dataclasses.replace(first, meta={"log": "second.mcap"}, **change)
    robot = SimpleNamespace(joint_names=("j1", "j2"))
    detector = SimpleNamespace(arm=SimpleNamespace(robot=robot), dt=1e-3)
    none = np.zeros(50)
    detection = Detection("none", t, still, none, 1.0, none > 0, ())
    alarm = SimpleNamespace(detector=detector, settle=0.0, detect=lambda trace: detection)
    episode = dataclasses.replace(first, meta={"episode": "test/3"})
    unnamed = dataclasses.replace(first, meta={})
    assert evaluate(Detector(alarm), [episode, unnamed]).names == ("test/3", "1")
    with pytest.raises(ValueError, match=said):
        evaluate(Detector(alarm), [first, second])


def quiet(t):
    """The truth of a recording in which nothing is touched."""
    zero, point = np.zeros((len(t), 2)), np.zeros((len(t), 3))
    return Truth(zero, zero[:, 0], (), zero[:, 0], np.zeros(len(t), int), point, point)


def test_a_model_file_that_was_not_named_is_not_replaced(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.tauguard").write_text("older")
    assert "--model" in fails(capsys, "train", "--traces", str(tmp_path))
    assert (tmp_path / "model.tauguard").read_text() == "older"


def test_train_any_detector_with_a_guarantee(tmp_path, capsys):
    """Few recordings guarantee little; the message says how many more would do."""
    struck, free = tmp_path / "struck", tmp_path / "free"
    common = ("--workers", "1", "--payloads-g", "0", "--speeds", "30")
    run("simulate", "--out", str(struck), "--episodes", "1", "--collisions", "5", *common)
    more = ("--episodes", "6", "--collisions", "0", "--seconds", "8", *common)
    run("simulate", "--out", str(free), *more)
    for path in sorted(free.glob("*.mcap"))[:3]:
        path.rename(struck / f"free-{path.name}")
    model = str(tmp_path / "model.tauguard")
    train = ("train", "--traces", str(struck), "--model", model)
    assert "did you mean 'srq-svr'" in fails(capsys, *train, "--detector", "srq-svm")
    flags = ("--detector", "moving-thresholds", "--calibration", str(free))
    line = fails(capsys, *train, *flags, "--false-alarms-per-hour", "1")
    assert "cannot guarantee 1 false alarms per hour" in line
    assert "give " in line
    line = fails(capsys, *train, *flags, "--false-alarms-per-hour", "600", "--confidence", "0.999")
    assert "with confidence 0.999" in line
    assert "give --calibration" in fails(capsys, *train, "--confidence", "0.9")
    run(*train, *flags, "--false-alarms-per-hour", "600")
    assert "at most 600 false alarms per hour" in capsys.readouterr().out
    run("evaluate", "--traces", str(struck), "--model", model)
    assert "sensitivity from 16 N m up" in capsys.readouterr().out


def test_detect_with_a_trained_model(tmp_path, capsys):
    """The model of a simulated arm watches a recording of it; a log at another rate is refused."""
    from tauguard.datasets import free_episodes, struck_episodes, write_dataset
    from tauguard.models import cura6

    episodes = [
        *struck_episodes(6, 1, 5, (30.0,)),
        *free_episodes(6, 2, 12.0, (30.0,)),
    ]
    paths = write_dataset(episodes, tmp_path, workers=1)
    model, robot = tmp_path / "model.tauguard", tmp_path / "arm.xml"
    robot.write_text(cura6.arm_xml())
    run("train", "--traces", str(tmp_path), "--model", str(model), "--folds", "1")
    found = tmp_path / "found.json"
    flags = ("--robot", str(robot), "--model", str(model), "--json", str(found))
    run("detect", str(paths[0]), *flags)
    result = json.loads(found.read_text())
    assert result["detector"] == "srq-svr"
    assert 3 <= len(result["events"]) <= 6
    assert all(sum(event["links"]) == pytest.approx(1.0) for event in result["events"])
    kinds = [event["kind"] for event in result["events"]]
    assert set(kinds) <= {"transient", "clamp", "push"}
    out = capsys.readouterr().out
    assert f"{kinds[0]}, " in out
    assert "peak force " in out
    assert all(0 <= e["peak_force_n"]["low"] <= e["peak_force_n"]["high"] for e in result["events"])
    rows = ["time,q1,q2,q3,q4,q5,q6"] + [f"{k / 100},0,0,0,0,0,0" for k in range(500)]
    log, columns = tmp_path / "slow.csv", tmp_path / "columns.json"
    log.write_text("\n".join(rows))
    names = [f"q{i}" for i in range(1, 7)]
    columns.write_text(json.dumps({"t": "time", "q": names, "qd": names, "current": names}))
    line = fails(capsys, "detect", str(log), *flags, "--columns", str(columns))
    assert "works at 1 ms" in line
