"""``tauguard listen`` beside a played robot: the same alarms as ``detect``, faults named."""

import json
import os
import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tauguard as tg
from tauguard.cli import main
from tauguard.cli.listen import Terminal
from tauguard.cli.listen import read_log as read_played
from tauguard.datasets.plans import free_episodes, struck_episodes
from tauguard.detectors import ArmModel, Detector, RobotNumbers, make_detector, save_model
from tauguard.detectors.alarms.monitor import Answer, Monitor, detect_with_faults
from tauguard.detectors.alarms.training import train
from tauguard.envs import simulate
from tauguard.live import Listening, PlayedStream, StreamClosed, UrServer, UrStream, rtde, ur
from tauguard.live.listening import check_stream
from tauguard.live.packets import Fault, Packets
from tauguard.live.session import BINS, Session, listen
from tauguard.models import Mismatch, cura6, cura6_drive, pin_model
from tauguard.traces import write_mcap
from tauguard.traces.trace import Trace
from tests.live.peer import Peer

ARM = Mismatch(seed=3)


def every_fourth(trace):
    """At 250 Hz: what a busy machine can be asked to play in real time."""
    return Trace(trace.joint_names, trace.t[::4], trace.q[::4], trace.qd[::4], trace.current[::4])


@pytest.fixture(scope="module")
def alarm():
    episodes = free_episodes(5, 3, 12.0, (30.0, 60.0), (0.0,), ARM)
    traces = [every_fourth(simulate(episode)) for episode in episodes]
    robot = RobotNumbers.from_pin(pin_model(cura6.arm_xml()))
    arm = ArmModel(robot, np.array(cura6_drive().gain))
    return train(make_detector("residual-thresholds"), traces, arm, 5.0)


@pytest.fixture(scope="module")
def struck():
    whole = every_fourth(simulate(struck_episodes(8, 1, 3, (40.0,), (0.0,), ARM)[0]))
    keep = whole.t < whole.t[0] + 9
    return Trace(
        whole.joint_names, whole.t[keep], whole.q[keep], whole.qd[keep], whole.current[keep]
    )


class Handed(PlayedStream):
    """The samples of a log as fast as they are asked for."""

    def __init__(self, trace):
        super().__init__(trace, pace=1e9)

    def read(self, timeout):
        sample = super().read(timeout)  # as if it came at once: a busy machine makes nothing late
        return None if sample is None else replace(sample, arrived=round(1e9 * sample.t))


def test_the_same_alarms_as_on_the_file(alarm, struck):
    heard = listen(Handed(struck), Monitor(alarm, alarm.inputs), keep=True)
    found = alarm.detect(struck)
    assert heard.samples == len(struck.t)
    assert heard.ended == "the log is over"
    assert np.array(heard.scores).tobytes() == found.score.tobytes()
    assert heard.alarms == found.alarm.tolist()
    assert np.array_equal(heard.trace().current, struck.current)


def test_a_log_and_a_stream_give_the_same_session(alarm, struck):
    detector, rows = Detector(alarm), slice(0, 250)
    signals = (getattr(struck, name)[rows] for name in ("t", "q", "qd", "current"))
    short = Trace(struck.joint_names, *signals)
    back = tuple(reversed(struck.joint_names))
    mixed = Trace(back, short.t, *(x[:, ::-1] for x in (short.q, short.qd, short.current)))
    played = [tg.listen(detector, one, keep=True) for one in (short, tg.read_log(mixed))]
    handed = tg.listen(detector, Handed(short), keep=True)
    for one in played:
        assert one.trace().q.tobytes() == handed.trace().q.tobytes()
        assert one.detection().score.tobytes() == handed.detection().score.tobytes()
    assert repr(handed).startswith(
        "Listening(1.0 s, 0 collisions, 0 faults, the log is over; state"
    )
    assert handed.to_dict()["findings"] == []
    assert [row["state"] for row in handed.rows()] == ["collision"] * handed.to_dict()["alarms"]
    with pytest.raises(tg.MismatchError, match="`torque=True`: the detector was trained on"):
        tg.listen(detector, short, torque=True)


def test_over_rtde_nothing_is_lost(alarm, struck):
    with (
        UrServer(Packets.of(struck), 0) as server,
        UrStream("127.0.0.1", server.port, 250.0, reconnect=0) as source,
    ):
        check_stream(source, Detector(alarm))
        heard = listen(source, Monitor(alarm, alarm.inputs), keep=True)
        assert source.events == []
    assert heard.samples == len(struck.t)
    assert np.array(heard.scores).tobytes() == alarm.detect(struck).score.tobytes()
    quantiles = heard.quantiles()
    assert 0 < quantiles["median"] <= quantiles["p99"]


def test_every_line_says_why(struck, capsys):
    terminal, samples = Terminal(1.0), iter(Handed(struck).read(0) for _ in range(8))
    wrong = "torque: the current of a works against the motion (-0.52 of ...)"
    for answer in (
        Answer("free", False, 0.2, ""),
        Answer("collision", True, 1.5, ""),
        Answer("collision", True, 1.6, ""),
        Answer("collision", True, 1.7, wrong),
        Answer("collision", True, 1.8, wrong.replace("52", "61")),
        Answer("collision", True, 0.0, "gap: nothing for 40 ms"),
        Answer("collision", True, 0.0, f"settling again after {wrong}"),
        Answer("fault", False, 0.5, wrong),
    ):
        terminal.show(next(samples), answer)
    shown = capsys.readouterr().out.replace("\r", "").strip().split("\n")
    lines = [line.split("s  ", 1)[1].strip() for line in shown]
    assert lines == [
        "free",
        "collision: score 1.50 above 1.00",
        f"collision: score 1.70 above 1.00; {wrong}",
        "collision: the alarm was on already; gap: nothing for 40 ms",
        f"fault: {wrong}",
    ]


def test_latencies_beyond_the_last_bin_are_not_given_a_number(alarm):
    heard = Session(("a",))
    heard.samples, heard.slowest = 1000, 250_000_000
    heard.counts[[40, BINS]] = 995, 5
    found = heard.quantiles()
    assert (found["median"], found["p99"], found["p99_9"], found["max"]) == (41, 41, None, 250_000)
    assert "p99 41, p99.9 100,000 or more, " in str(Listening(Detector(alarm), heard))


def test_a_silent_robot_is_a_fault(alarm, struck):
    class Silent(Handed):
        def read(self, timeout):
            if self._next < 1000:
                return super().read(timeout)
            if self._next < 1003:
                self._next += 1
                threading.Event().wait(timeout)
                return None
            raise StreamClosed("gone")

    heard = listen(Silent(struck), Monitor(alarm, alarm.inputs))
    assert heard.state.startswith("fault: no samples: nothing for ")
    last = heard.faults()[-1]
    assert last.reason.startswith("no samples: nothing for ")
    assert last.end - last.start > 0.02


def states(alarm, trace, late, stamps):
    """What is said at every sample that comes ``late`` [s] with the time ``stamps`` [s]."""

    class Behind(Handed):
        def read(self, timeout):
            k = self._next
            sample = super().read(timeout)
            arrived = round(1e9 * (trace.t[k] + late[k]))
            return replace(sample, t=float(stamps[k]), arrived=arrived)

    said = []

    def report(sample, answer):
        if np.isfinite(sample.q).all():  # not while a busy machine gives none
            said.append(answer.state)

    listen(Behind(trace), Monitor(alarm, alarm.inputs), report=report)
    return said


def test_one_stale_packet_erases_no_backlog(alarm, struck):
    late = np.where(np.arange(len(struck.t)) < 1000, 0.0, 0.3)
    stamps = struck.t.copy()
    stamps[1200] = struck.t[1198]
    said = states(alarm, struck, late, stamps)
    assert "free" in said[:1000]
    assert "free" not in said[1000:]


def test_a_robot_whose_clock_begins_anew_is_not_late_for_ever(alarm, struck):
    def back(trace, seconds):
        return trace.t - np.where(np.arange(len(trace.t)) < 1000, 0.0, seconds)

    said = states(alarm, struck, np.zeros(len(struck.t)), back(struck, struck.t[1000]))
    assert said[1000] == "fault"
    assert "free" in said[-100:]
    assert "free" not in states(alarm, struck, np.zeros(len(struck.t)), back(struck, 0.1))[1000:]


def test_samples_without_a_time_are_a_fault_in_the_summary(alarm, struck):
    class Timeless(Handed):
        def read(self, timeout):
            late = 1000 <= self._next < 1200
            sample = super().read(timeout)
            return replace(sample, t=np.nan) if late else sample

    heard = listen(Timeless(struck), Monitor(alarm, alarm.inputs))
    named = [one for one in heard.faults() if one.reason == "not-finite: the time is nan"]
    assert [one.start for one in named] == [pytest.approx(struck.t[1000])]


def test_a_frozen_robot_is_a_fault_and_no_collision(alarm, struck):
    packets = Fault("frozen", 4.0, 0.5).apply(Packets.of(struck))
    frozen = Trace(struck.joint_names, packets.t, packets.q, packets.qd, packets.current)
    heard = listen(Handed(frozen), Monitor(alarm, alarm.inputs))
    faults = heard.spans.of("fault")
    assert 4.0 <= faults[0].start - struck.t[0] <= 4.02
    assert not any(
        span.state == "collision" and 4.0 < span.start - struck.t[0] < 4.5
        for span in heard.spans.found
    )


def test_a_file_is_answered_as_the_stream_is(alarm, struck):
    whole = detect_with_faults(alarm, struck)
    assert whole.faults == ()
    assert whole.detection.alarm.tolist() == alarm.detect(struck).alarm.tolist()
    packets = Fault("frozen", 4.0, 0.5).apply(Packets.of(struck))
    frozen = Trace(struck.joint_names, packets.t, packets.q, packets.qd, packets.current)
    heard = listen(Handed(frozen), Monitor(alarm, alarm.inputs))
    found = detect_with_faults(alarm, frozen)
    spans = [(s.start, s.end, s.reason) for s in heard.spans.of("fault")]
    assert [(s.start, s.end, s.reason) for s in found.faults] == spans
    assert 0.5 <= found.fault_seconds <= 0.5 + alarm.settle + 0.1


def test_a_long_file_takes_no_longer_a_sample(alarm, struck, monkeypatch):
    # The interval is a median over the whole trace: asked at every sample it takes an hour a file.
    asked, interval = [], Trace.dt.fget
    monkeypatch.setattr(Trace, "dt", property(lambda trace: asked.append(0) or interval(trace)))
    detect_with_faults(alarm, struck)
    assert len(asked) < 20


def test_its_size_does_not_grow_with_time(alarm, struck):
    heard = listen(Handed(struck), Monitor(alarm, alarm.inputs))
    assert heard.rows == []
    assert heard.counts.sum() == heard.samples


@pytest.mark.parametrize(("joints", "rate", "said"), [(5, 250, "5 joints"), (6, 125, "trained at")])
def test_another_robot_is_refused_before_anything_is_watched(alarm, joints, rate, said):
    t = np.arange(0, 1, 1 / rate)
    names = tuple(f"j{i}" for i in range(joints))
    still = Trace(names, t, *(np.zeros((len(t), joints)) for _ in range(3)))
    with pytest.raises(ValueError, match=said):
        check_stream(PlayedStream(still), Detector(alarm))


def test_the_summary_is_json(alarm, struck):
    result = tg.listen(Detector(alarm), Handed(struck)).to_dict()
    assert json.loads(json.dumps(result))["samples"] == len(struck.t)
    assert set(result["latency_us"]) == {"median", "p99", "p99_9", "p99_99", "max"}


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, "give one of --ur HOST, --play LOG, --stdin and --ros TOPIC"),
        ({"ur": "h", "stdin": True}, "give one of"),
        ({"ur": "h", "torque": True}, "--torque cannot be combined with --ur"),
        ({"stdin": True, "rerun": "a.mp4"}, "expected `view`, or a file that ends with .rrd"),
        ({"stdin": True, "rerun": "no_such/a.rrd"}, "the folder no_such does not exist"),
        ({"stdin": True, "json": "no_such/a.json"}, "the folder no_such does not exist"),
    ],
)
def test_flags_that_do_not_fit_are_named_before_anything_is_read(given, said):
    from tauguard.cli.listen import command

    paths = {key: Path(value) for key, value in given.items() if key == "json"}
    with pytest.raises(ValueError, match=said):
        command(Path("none.tauguard"), Path("none.urdf"), **(given | paths))


@pytest.fixture(scope="module")
def files(alarm, tmp_path_factory):
    folder = tmp_path_factory.mktemp("listen")
    save_model(alarm, folder / "model.tauguard")
    (folder / "arm.xml").write_text(cura6.arm_xml())
    return folder


def given(files):
    return ["listen", "--model", str(files / "model.tauguard"), "--robot", str(files / "arm.xml")]


def test_a_robot_that_leaves_is_a_fault_on_the_screen_in_json_and_in_the_exit_code(
    files, struck, capsys
):
    signals = (x[:500] for x in (struck.t, struck.q, struck.qd, struck.current))
    part = Trace(struck.joint_names, *signals)
    with UrServer(Packets.of(part), 0) as server:
        flags = ["--port", str(server.port), "--reconnect", "0.5", "--json", str(files / "a.json")]
        with pytest.raises(SystemExit) as stop:
            main([*given(files), "--ur", "127.0.0.1", *flags])
    assert stop.value.code == 3
    out = capsys.readouterr().out
    screen, _, summary = out.partition("\nfault ")
    assert (
        screen.replace("\r", "\n")
        .rstrip()
        .splitlines()[-1]
        .strip()
        .split("  ")[1]
        .startswith("fault: no samples: nothing for 0.02")
    )
    assert ": no samples: nothing for " in summary
    assert "state at the end: fault: no samples: nothing for " in summary
    result = json.loads((files / "a.json").read_text())
    assert result["state"].startswith("fault: no samples: nothing for ")
    last = result["faults"][-1]
    assert last["reason"].startswith("no samples")
    assert last["start"] == pytest.approx(part.t[-1])
    assert last["end"] - last["start"] > 0.5


def test_a_pipe_that_says_nothing_is_a_fault(files, monkeypatch, capsys):
    out, into = os.pipe()
    with open(out) as text:
        monkeypatch.setattr(sys, "stdin", text)
        main([*given(files), "--stdin", "--seconds", "0.5", "--json", str(files / "b.json")])
    os.close(into)
    screen = capsys.readouterr().out
    assert "  fault: no samples: nothing for 0.0" in screen
    assert "free" not in screen
    result = json.loads((files / "b.json").read_text())
    (fault,) = result["faults"]
    assert fault["start"] == 0.0
    assert fault["end"] == pytest.approx(0.5, abs=0.2)
    assert result["state"].startswith("fault: no samples")
    assert result["seconds"] == 0.0


def test_what_reading_a_played_log_mended_is_said(alarm, struck, tmp_path, capsys):
    rows = np.column_stack([struck.t, struck.q, struck.qd, struck.current])[:50]
    rows[[20, 21]] = rows[[21, 20]]
    names = ["t", *(f"{what}_{i}" for what in ("q", "qd", "current") for i in range(1, 7))]
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header=",".join(names), comments="")
    read_played(tmp_path / "a.csv", "auto", Detector(alarm))
    assert "note: a.csv: rows sorted by time; 1 were out of order" in capsys.readouterr().out


def test_the_robot_in_the_model_file_is_enough(alarm, files, struck, tmp_path, capsys):
    signals = (x[:200] for x in (struck.t, struck.q, struck.qd, struck.current))
    log, shown = tmp_path / "a.mcap", tmp_path / "a.rrd"
    write_mcap(log, Trace(struck.joint_names, *signals))
    save_model(alarm, tmp_path / "whole.tauguard", robot=files / "arm.xml")
    flags = ["--play", str(log), "--rerun", str(shown)]
    main(["listen", "--model", str(tmp_path / "whole.tauguard"), *flags])
    assert "free" in capsys.readouterr().out
    assert shown.stat().st_size > 10_000
    with pytest.raises(SystemExit):
        main(["listen", "--model", str(files / "model.tauguard"), *flags])
    assert "--rerun needs --robot: the model file has no robot" in capsys.readouterr().err


@pytest.mark.slow
def test_an_hour_of_samples(alarm, struck, capsys):
    """Memory stays flat, no sample is lost; an hour at 250 Hz as fast as it can be read."""
    samples, rate, block = 900_000, 250.0, 1000
    rng, recipe = np.random.default_rng(0), rtde.Recipe(1, tuple(ur.VARIABLES.values()))
    one = np.concatenate([struck.q[0], 0 * struck.qd[0], struck.current[0]])
    noise = np.repeat([1e-5, 1e-4, 1e-2], 6)
    used = []

    def send(peer, client):
        peer.shake_hands(client)
        for first in range(0, samples, block):
            rows = one + noise * rng.normal(size=(block, 18))
            times = (first + np.arange(block)) / rate
            client.sendall(
                b"".join(recipe.pack([t, *row]) for t, row in zip(times, rows, strict=True))
            )
        peer._over.wait(60)

    def report(sample, answer):
        if sample.t * rate % 100_000 < 1:
            pages = int(Path("/proc/self/statm").read_text().split()[1])
            used.append(pages * os.sysconf("SC_PAGESIZE") / 2**20)
        if sample.t * rate >= samples - 1.5:
            raise StreamClosed("the hour is over")

    with Peer(send) as peer, UrStream("127.0.0.1", peer.port, rate) as stream:
        session = listen(stream, Monitor(alarm, alarm.inputs), report=report)
        assert stream.events == []
    assert session.samples == samples
    assert used[-1] - used[1] < 4.0, f"MiB at every 100,000 samples: {used}"
    with capsys.disabled():
        print(f"\n{samples} samples; MiB {used[1]:.1f} to {used[-1]:.1f}; us {session.quantiles()}")
