"""Files of strangers: whatever their bytes, an answer or one line, quickly and within bounds."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tauguard.benchmarks.mutants import FORMATS, originals, tried
from tauguard.datasets import read_log
from tauguard.models.arm import load_arm
from tauguard.models.nominal import compiled
from tauguard.strangers import read_json, read_text, reading
from tauguard.traces import read_mcap


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    return originals(tmp_path_factory.mktemp("originals"))


@pytest.mark.parametrize("kind", FORMATS)
def test_mutants_end_in_an_answer_or_in_one_line(kind, files, tmp_path):
    rng = np.random.default_rng(7)
    for number in range(3 if kind == "mjcf" else 12):
        outcome = tried(kind, files[kind], tmp_path, rng)
        assert outcome.ok, (number, outcome)


def test_nesting_numbers_and_types_that_no_reader_expects(tmp_path):
    path = tmp_path / "columns.json"
    for text in ("[" * 100_000, "[" + "9" * 5000, '{"t": {"a": ', "null", '{"a": NaN', "\x00"):
        path.write_text(text)
        if text == "null":
            assert read_json(path) is None
            continue
        with pytest.raises(ValueError, match=f"^{re.escape(str(path))}: [^\n]*$"):
            read_json(path)


def read_badly(raised):
    with reading("log.csv", "expected a log"):
        raise raised


def test_any_exception_of_a_reader_is_one_line():
    for raised in (KeyError("joint_names"), RecursionError("deep"), OverflowError("400 digits")):
        with pytest.raises(ValueError, match=r"^log\.csv: .*; expected a log$") as caught:
            read_badly(raised)
        assert caught.value.__cause__ is raised
    with pytest.raises(FileNotFoundError), reading("log.csv"):
        raise FileNotFoundError("log.csv")


def test_a_text_file_without_an_end(tmp_path):
    with pytest.raises(ValueError, match="more than 1 MiB"):
        read_text("/dev/zero", 1 << 20)


@pytest.mark.parametrize("text", ['t,q\n"1,2\n3,4\n', "t," + "9" * 300_000 + "\n1,2\n"])
def test_csv_with_an_open_quote_or_a_huge_field(text, tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"log\.csv: "):
        read_log(path)


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_mcap_bomb_is_refused_before_it_unpacks(compression, tmp_path):
    from mcap.writer import CompressionType, Writer

    path = tmp_path / "bomb.mcap"
    with open(path, "wb") as stream:
        writer = Writer(stream, 1 << 31, CompressionType[compression.upper()])
        writer.start()
        schema = writer.register_schema("sensor_msgs/msg/JointState", "ros2msg", b"")
        channel = writer.register_channel("/joint_states", "cdr", schema)
        for k in range(2):
            writer.add_message(channel, k, bytes(70 << 20), k)
        writer.finish()
    assert path.stat().st_size < 2_000_000
    for read in (read_log, read_mcap):
        start = time.monotonic()
        with pytest.raises(ValueError, match=r"unpacks to \d+ bytes|no metadata record"):
            read(path)
        assert time.monotonic() - start < 10


ARM = """<mujoco><worldbody><body name="a"><joint name="j"/><geom size="0.1" mass="1"/></body>
</worldbody>%s</mujoco>"""


@pytest.mark.parametrize(
    "part",
    [
        '<include file="../secret.xml"/>',
        '<asset><mesh name="m" file="../../x.stl"/></asset>',
        '<compiler meshdir="/etc"/>',
    ],
)
def test_a_robot_file_names_nothing_outside_its_folder(part, tmp_path):
    (tmp_path / "secret.xml").write_text("<mujoco/>")
    robot = tmp_path / "robot" / "arm.xml"
    robot.parent.mkdir()
    robot.write_text(ARM % part)
    for load in (compiled, load_arm):
        with pytest.raises(ValueError, match="outside its folder"):
            load(str(robot))


def test_a_robot_file_on_which_mujoco_would_crash_is_one_line(tmp_path, monkeypatch):
    import tauguard.models.robot_check as robot_check

    robot = tmp_path / "arm.xml"
    robot.write_text(ARM % "")
    crash = "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)"
    monkeypatch.setattr(robot_check, "_TRIAL", crash)
    with pytest.raises(ValueError, match="does not survive it"):
        compiled(str(robot))
    monkeypatch.setattr(robot_check, "_TRIAL", "import time; time.sleep(60)")
    monkeypatch.setattr(robot_check, "MOST_SECONDS", 0.5)
    robot.write_text(ARM % " ")
    with pytest.raises(ValueError, match=r"more than 0\.5 s"):
        compiled(str(robot))


def simulate(folder, *more):
    command = (
        "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "
        "from tauguard.cli import main; main(sys.argv[1:])"
    )
    flags = ["simulate", "--out", str(folder), "--collisions", "0", "--seconds", "30", *more]
    return subprocess.Popen(
        [sys.executable, "-c", command, *flags],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip


def children(pid):
    found = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = status.read_text().rsplit(")", 1)[1].split()
            line = (status.parent / "cmdline").read_text()
        except OSError:
            continue
        if int(fields[1]) == pid and "spawn_main" in line:
            found.append(int(status.parent.name))
    return found


def until(condition, seconds=90):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


@pytest.mark.parametrize("what", ["SIGINT", "SIGTERM", "dead worker"])
def test_simulate_with_workers_ends_at_once_and_a_rerun_gives_the_same_bytes(what, tmp_path):
    folder = tmp_path / "out"
    run = simulate(folder, "--workers", "2", "--episodes", "3")
    # A worker that dies at its first task; the signals come when a file is there.
    early = what == "dead worker"
    until(lambda: len(children(run.pid)) == 2 and (early or list(folder.glob("episode-*"))))
    start = time.monotonic()
    if early:
        os.kill(children(run.pid)[0], signal.SIGKILL)
    else:
        os.kill(run.pid, signal.Signals[what])
    _, error = run.communicate(timeout=60)
    assert time.monotonic() - start < 10  # 5 on a machine that is not busy
    assert len([line for line in error.splitlines() if line.startswith("tauguard ")]) == 1
    assert "Traceback" not in error
    assert run.returncode == {"SIGINT": 130, "SIGTERM": 143, "dead worker": 2}[what]
    assert not list(folder.glob(".*"))
    again = simulate(folder, "--workers", "1", "--episodes", "3")
    again.communicate(timeout=120)
    fresh = simulate(tmp_path / "fresh", "--workers", "2", "--episodes", "3")
    fresh.communicate(timeout=120)
    for path in sorted((tmp_path / "fresh").iterdir()):
        assert path.read_bytes() == (folder / path.name).read_bytes()


def test_columns_of_wrong_types_are_one_line(tmp_path):
    from tauguard.cli.real_logs import column_map

    path = tmp_path / "columns.json"
    wrong = {"t": 1, "q": 3, "qd": None, "current": {}}
    for fields in (wrong, wrong | {"t": []}, wrong | {"repair": 7}):
        path.write_text(json.dumps(fields))
        with pytest.raises(ValueError, match=r"columns\.json: [^\n]*$"):
            read_log(tmp_path / "none.csv", column_map(str(path)))
