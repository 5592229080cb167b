"""Files of strangers: whatever their bytes, an answer or one line, quickly and within bounds."""

import json
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from oracles import file_contents
from slow import damaged, endurance, interrupted, readers
from slow.damaged import Reading, Worker
from slow.formats import FORMATS
from slow.originals import WRITERS
from slow.recordings import command as write_recordings
from tauguard.cli import main
from tauguard.datasets import read_log
from tauguard.live import rtde
from tauguard.models.arm import load_arm
from tauguard.models.nominal import compiled
from tauguard.traces import read_mcap
from tauguard.untrusted_input import read_json, read_text, reading


@pytest.fixture(scope="module")
def damaged_files(tmp_path_factory):
    return Reading(tuple(FORMATS), tmp_path_factory.mktemp("originals"))


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("kind", FORMATS)
def test_mutants_end_in_a_right_answer_or_in_one_line(kind, damaged_files):
    # `pytest -m slow -k damaged_file` tries ten thousand, in a process of limited memory.
    for number in range(20):
        outcome = damaged_files.tried(kind, (7, number))
        assert outcome.ok, (number, outcome)


def test_a_reader_that_dies_or_hangs_is_counted(monkeypatch):
    worker = Worker(("columns",))
    assert worker.tried("columns", (0,)).ok
    os.kill(worker._process.pid, signal.SIGKILL)
    assert worker.tried("columns", (1,)).said == "crash"
    assert worker.tried("columns", (1,)).ok  # by another process
    monkeypatch.setattr(damaged, "MOST_SECONDS", -4.0)  # a second in all
    os.kill(worker._process.pid, signal.SIGSTOP)
    assert worker.tried("columns", (2,)).said == "hang"


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
    with pytest.raises(ValueError, match=r"/dev/zero: more than \d+ MiB"):
        read_text("/dev/zero")


@pytest.mark.parametrize("text", ['t,q\n"1,2\n3,4\n', "t," + "9" * 300_000 + "\n1,2\n"])
def test_csv_with_an_open_quote_or_a_huge_field(text, tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"log\.csv: "):
        read_log(path)


def test_bombs_of_nesting_in_robot_and_model_files(tmp_path):
    import zipfile

    from tauguard.detectors import load_model

    robot, model = tmp_path / "arm.urdf", tmp_path / "model.tauguard"
    for text in ("<link>" * 60_000, "<link>" * 20_000 + "</link>" * 20_000 + "</robot>"):
        robot.write_text('<robot name="a">' + text)
        with pytest.raises(ValueError, match=r"^[^\n]*(not well-formed|nested more than)[^\n]*$"):
            compiled(str(robot))
    for text in ("[" * 100_000, '{"a":' * 50_000 + "1" + "}" * 50_000):
        with zipfile.ZipFile(model, "w") as archive:
            archive.writestr("model.json", text)
        with pytest.raises(ValueError, match=r"^[^\n]*not a model file, or a damaged one[^\n]*$"):
            load_model(model)


@pytest.mark.parametrize(("count", "size"), [(2, 70 << 20), (7, 10 << 20)])
@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_mcap_bomb_is_refused_before_it_unpacks(compression, count, size, tmp_path):
    from mcap.writer import CompressionType, Writer

    path = tmp_path / "bomb.mcap"
    with open(path, "wb") as stream:
        writer = Writer(stream, size, CompressionType[compression.upper()])
        writer.start()
        schema = writer.register_schema("sensor_msgs/msg/JointState", "ros2msg", b"")
        channel = writer.register_channel("/joint_states", "cdr", schema)
        for k in range(count):
            writer.add_message(channel, k, bytes(size), k)
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
        '<asset><mesh name="m" file="..\\x.stl"/></asset>',
        '<include file="..\\secret.xml"/>',
        *(
            f'<asset><texture name="t" type="cube" file{side}="../x.png"/></asset>'
            for side in ("right", "left", "up", "down", "front", "back")
        ),
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
    from tauguard.models.robot_check import Trial

    robot = tmp_path / "arm.xml"
    robot.write_text(ARM % "")
    crash = "os.kill(os.getpid(), signal.SIGSEGV)"
    monkeypatch.setattr(robot_check, "TRIAL", Trial(crash))
    with pytest.raises(ValueError, match="does not survive it"):
        compiled(str(robot))
    monkeypatch.setattr(robot_check, "TRIAL", Trial("import time; time.sleep(60)", 0.5))
    robot.write_text(ARM % " ")
    with pytest.raises(ValueError, match=r"more than 0\.5 s"):
        compiled(str(robot))
    monkeypatch.setattr(robot_check, "TRIAL", Trial("bytearray(2 << 30)"))
    robot.write_text(ARM % "  ")
    with pytest.raises(ValueError, match="more than 1 GiB of memory"):
        compiled(str(robot))
    monkeypatch.setattr(robot_check, "TRIAL", Trial("while True: pass", 60.0))
    robot.write_text(ARM % "   ")
    with pytest.raises(ValueError, match="more than 3 s of processor time"):
        compiled(str(robot))


def test_a_robot_file_with_a_texture_of_gigabytes_is_refused_in_ten_seconds(tmp_path):
    robot = tmp_path / "arm.xml"
    size = 'builtin="checker" width="30000" height="30000"'
    robot.write_text(ARM % f'<asset><texture name="t" type="2d" {size}/></asset>')
    for load in (compiled, load_arm):
        began = time.monotonic()
        with pytest.raises(ValueError, match="more than 1 GiB of memory"):
            load(str(robot))
        assert time.monotonic() - began < 10


@pytest.mark.parametrize(("kind", "workers"), list(interrupted.TRIALS))
def test_what_is_written_is_whole_however_a_run_ends(kind, workers, truth, tmp_path):
    # `pytest -m slow -k interrupted` does it 520 times.
    if kind == "full disk" and not interrupted.mounting():
        pytest.skip("no small disk can be mounted here: only root can")
    count = interrupted.Count()
    (tmp_path / "truth").symlink_to(truth)
    interrupted.trial(kind, workers, tmp_path, np.random.default_rng(workers), count)
    bad = {name: n for name, n in count.found.items() if n and name not in ("finished", "late")}
    assert not bad, (kind, count)
    assert count.longest < 20  # a second or two on a machine that is not busy


@pytest.fixture(scope="module")
def truth(tmp_path_factory):
    folder = tmp_path_factory.mktemp("truth")
    assert write_recordings(folder, 1) == 0
    return folder


def test_simulate_with_workers_ends_at_once_and_a_rerun_gives_the_same_bytes(tmp_path):
    folder, fresh = tmp_path / "out", tmp_path / "fresh"
    flags = ["--collisions", "0", "--seconds", "3", "--episodes", "3"]
    command = [sys.executable, "-m", "tauguard", "simulate", "--out", str(folder), *flags]
    run = subprocess.Popen([*command, "--workers", "2"], stderr=subprocess.PIPE, text=True)
    until = time.monotonic() + 120
    while not list(folder.glob("*.mcap")) and time.monotonic() < until:
        time.sleep(0.01)
    start = time.monotonic()
    run.send_signal(signal.SIGTERM)
    _, error = run.communicate(timeout=60)
    assert time.monotonic() - start < 10  # a fraction of a second on a machine that is not busy
    assert run.returncode in (0, 143)
    assert error == ("tauguard simulate: stopped\n" if run.returncode else "")
    assert not list(folder.glob(".*"))
    for where in (folder, fresh):
        main(["simulate", "--out", str(where), *flags, "--workers", "1"])
    for path in sorted(fresh.iterdir()):
        assert path.read_bytes() == (folder / path.name).read_bytes()


def test_columns_of_wrong_types_are_one_line(tmp_path):
    from tauguard.datasets.columns import column_map

    path = tmp_path / "columns.json"
    wrong = {"t": 1, "q": 3, "qd": None, "current": {}}
    for fields in (wrong, wrong | {"t": []}, wrong | {"repair": 7}):
        path.write_text(json.dumps(fields))
        with pytest.raises(ValueError, match=r"columns\.json: [^\n]*$"):
            read_log(tmp_path / "none.csv", column_map(str(path)))


def test_a_stream_with_a_short_data_packet_ends_there_and_other_samples_are_wrong(tmp_path):
    path = tmp_path / "a.rtde"
    WRITERS["rtde"](path)
    data = path.read_bytes()
    size = 3 + 1 + 8 * 19
    begin = len(data) - 10 * size  # of the 51st of its 60 packets
    path.write_bytes(data[:begin] + rtde.packet(rtde.DATA_PACKAGE, b"\x01short") + data[begin:])
    found = readers.rtde(path)
    assert len(found) == 50
    assert file_contents.as_rtde(path, found, None) == ""
    assert file_contents.as_rtde(path, found[:-1], None) == "other samples"
    assert (
        file_contents.as_rtde(path, [*found[:-1], [0.5, *found[-1][1:]]], None) == "other samples"
    )


def test_an_environment_is_watched_for_a_few_resets_and_actions():
    # `pytest -m slow -k endurance` does it for ten hours and 100,000 resets.
    env = endurance.environment(endurance.detector(9, 3, 6.0, (40.0,)), 0)
    for part in (endurance.reset(env, 4), endurance.moved(env, 0.0, 20)):
        assert part["memory_mib"] > 10
        assert part["wall_p50_us"] >= 0.5 * part["cpu_p50_us"] > 0
    assert endurance.moved(env, 0.4, 20)["rms_residual"] > 0


def test_a_trial_whose_process_ends_after_the_request_is_repeated(tmp_path):
    """The idle process can end between the request and its reading."""
    from tauguard.models.robot_check import Trial

    work = f"""
import pathlib
first = not (mark := pathlib.Path({str(tmp_path / "mark")!r})).exists()
mark.touch()
if first or "ends" in what["text"]: os.kill(os.getppid(), signal.SIGKILL)
"""
    assert Trial(work).of(text="<mujoco/>") is None
    assert "ends" in (Trial(work).of(text="ends") or "")
