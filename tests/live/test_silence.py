"""A robot that falls silent is a fault at once, whatever its stream does meanwhile."""

import itertools
import os
import socket
import sys
import threading
import time
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from tauguard.detectors.alarms.monitor import Answer, Spans
from tauguard.live import LineStream, PlayedStream, Sample, StreamClosed, UrStream, rtde, ur
from tauguard.live.ros import RosStream
from tauguard.live.session import listen
from tauguard.traces import Trace
from tests.live.peer import RATE, Peer, piped

#: A thread of a busy machine may wait so long for its turn [s].
BUSY = 0.25
FAULT_AFTER = 0.020


class AlwaysFree:
    """A monitor that has nothing to say against any sample."""

    def step(self, t, q, qd, current):
        return Answer("free", False, 0.1, "")


class Reports:
    """What was said when, and when samples came."""

    def __init__(self):
        self.said, self.samples = [], []

    def __call__(self, sample, answer):
        now = time.monotonic()
        self.said.append((now, answer.state, answer.reason))
        if np.isfinite(sample.q).all():
            self.samples.append(now)

    def check(self, began, ended):
        """The state is a fault at most 20 ms after each sample that none followed."""
        moments = [began, *self.samples, ended]
        silences = 0
        for last, following in itertools.pairwise(moments):
            if following - last > FAULT_AFTER + BUSY:
                silences += 1
                within = [(t, s) for t, s, r in self.said if last < t < following and r]
                assert within, "nothing was said during a silence"
                assert within[0][0] - last < FAULT_AFTER + BUSY
                assert {s for _, s in within} == {"fault"}
        return silences


def heard(stream, seconds=3.0, monitor=None):
    reports, began = Reports(), time.monotonic()
    with stream:
        session = listen(stream, monitor or AlwaysFree(), seconds, reports)
    return session, reports, reports.check(began, time.monotonic())


def leaves(peer, client):
    peer._listener.close()
    peer.shake_hands(client)
    peer.send_samples(client)


def stays_silent(peer, client):
    peer.shake_hands(client)
    peer.send_samples(client)
    peer._over.wait(60)


def chats(peer, client):
    peer.shake_hands(client)
    peer.send_samples(client)
    flood(peer, client)


def flood(peer, client):
    message = rtde.text_message("robot", "still here", 3) * 50
    while not peer._over.is_set():
        client.sendall(message)


def drips(peer, client):
    peer.shake_hands(client)
    peer.send_samples(client)
    client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    client.sendall(rtde.HEADER.pack(0xFFFF, rtde.DATA_PACKAGE))
    while not peer._over.is_set():
        client.sendall(b"\0")
        time.sleep(0.001)


def comes_back(peer, client):
    peer.shake_hands(client)
    peer.send_samples(client, 50, begin=2.0)
    peer._over.wait(60)


def closes(peer, client):
    peer.shake_hands(client)
    peer.send_samples(client)


def stream_of(peer, reconnect=10.0):
    return UrStream("127.0.0.1", peer.port, RATE, reconnect)


def test_a_robot_that_leaves_is_a_fault_until_it_is_given_up():
    with Peer(leaves) as peer:
        session, reports, silences = heard(stream_of(peer, reconnect=1.0), seconds=20.0)
    assert session.samples == 25
    assert silences == 1
    assert session.lost
    assert "connection lost" in session.ended
    assert session.state.startswith("fault: no samples: nothing for 1")
    fault = session.faults()[-1]
    assert fault.start == pytest.approx(24 / RATE)
    assert 0.9 < fault.end - fault.start < 2.5
    assert reports.said[-1][1] == "fault"


@pytest.mark.parametrize("manner", [stays_silent, chats, drips])
def test_an_open_connection_without_samples_is_a_fault(manner):
    with Peer(manner) as peer:
        session, _, silences = heard(stream_of(peer), seconds=1.5)
    assert session.samples == 25
    assert silences == 1
    assert session.state.startswith("fault: no samples: nothing for ")
    assert session.silences[-1].seconds > 0.5  # the samples take 0.2 s, more on a busy machine


@pytest.mark.parametrize("manner", [stays_silent, chats, drips])
def test_reading_keeps_its_deadline_against_a_peer_that_never_stops(manner):
    with Peer(manner) as peer, stream_of(peer) as stream:
        while stream.read(0.5) is not None:
            pass
        for _ in range(5):
            began = time.monotonic()
            assert stream.read(0.05) is None
            assert time.monotonic() - began < 0.05 + BUSY
        assert len(stream.events) <= 1001


def test_a_half_open_connection_is_given_up_and_opened_again(monkeypatch):
    monkeypatch.setattr(ur, "NO_DATA", 0.5)
    with Peer(stays_silent, comes_back) as peer:
        session, _, silences = heard(stream_of(peer), seconds=2.5)
    assert peer.clients >= 2
    assert session.samples > 25
    assert silences >= 1
    assert session.last > 2.0  # a sample of the second connection


def test_a_handshake_without_end_is_one_error_in_time(monkeypatch):
    monkeypatch.setattr(ur, "HANDSHAKE", 0.5)
    with Peer(flood) as peer:
        began = time.monotonic()
        with pytest.raises(ConnectionError, match="no answer to the handshake"):
            stream_of(peer)
        assert time.monotonic() - began < 0.5 + BUSY


def test_all_addresses_of_a_host_share_the_time_to_connect(monkeypatch):
    """An address that drops packets answers nothing at all."""
    asked = []

    def dropped(address, timeout):
        asked.append(address)
        time.sleep(timeout)
        raise TimeoutError("timed out")

    rows = [(0, 0, 0, "", (f"192.0.2.{k}", 30004)) for k in range(4)]
    monkeypatch.setattr(ur, "HANDSHAKE", 0.4)
    monkeypatch.setattr(ur.socket, "getaddrinfo", lambda *_, **__: rows)
    monkeypatch.setattr(ur.socket, "create_connection", dropped)
    began = time.monotonic()
    with pytest.raises(ConnectionError, match="does not answer"):
        UrStream("robot", 30004)
    assert time.monotonic() - began < 0.4 + BUSY
    assert [address for address, _ in asked] == [f"192.0.2.{k}" for k in range(4)]


def test_a_handshake_without_end_after_a_lost_connection_is_a_fault():
    with Peer(closes, flood) as peer:
        session, _, silences = heard(stream_of(peer, reconnect=1.0), seconds=20.0)
    assert peer.clients == 2
    assert silences == 1
    assert session.lost
    assert session.state.startswith("fault: no samples")


def test_reading_returns_in_time_while_the_connection_is_opened_again():
    with Peer(closes, flood) as peer, stream_of(peer, reconnect=2.0) as stream:
        while stream.read(0.5) is not None:
            pass
        for _ in range(10):
            began = time.monotonic()
            assert stream.read(0.02) is None
            assert time.monotonic() - began < 0.02 + BUSY


def test_a_closed_stream_stays_closed_while_it_is_opened_again():
    with Peer(closes, stays_silent) as peer:
        stream = stream_of(peer, reconnect=5.0)
        while stream.read(0.5) is not None:
            pass
        stream.close()
        with pytest.raises(StreamClosed):
            stream.read(0.1)


@pytest.mark.parametrize("drip", [False, True])
def test_a_pipe_without_samples_is_a_fault_from_the_beginning(drip):
    text, into = piped()
    stop = threading.Event()

    def write():
        while not stop.wait(0.0005):
            os.write(into, b"1")  # of a line that never ends

    writer = threading.Thread(target=write)
    if drip:
        writer.start()
    session, reports, silences = heard(LineStream(text, ("a", "b"), RATE), seconds=0.8)
    stop.set()
    if drip:
        writer.join()
    os.close(into)
    text.close()
    assert (session.samples, silences) == (0, 1)
    assert {state for _, state, _ in reports.said} == {"fault"}
    (fault,) = session.faults()
    assert fault.start == 0.0
    assert 0.7 < fault.end < 0.8 + BUSY


def test_a_pipe_that_begins_late_and_ends_early_is_a_fault_on_both_sides():
    text, into = piped()

    def write():
        time.sleep(0.5)
        for k in range(25):
            os.write(into, b"%.4f,0,0,0\n" % (100 + k / RATE))
            time.sleep(1 / RATE)

    threading.Thread(target=write, daemon=True).start()
    session, _, silences = heard(LineStream(text, ("a",), RATE), seconds=1.6)
    os.close(into)
    text.close()
    assert silences == 2
    faults = session.faults()
    assert faults[0].end == pytest.approx(100.0)
    assert faults[0].end - faults[0].start == pytest.approx(0.5, abs=BUSY)
    assert faults[-1].start == pytest.approx(100 + 24 / RATE)
    assert 0.4 < faults[-1].end - faults[-1].start < 1.0 + BUSY


@pytest.fixture
def topic(monkeypatch):
    """A stand-in for ROS 2: what a subscription is given, without a ROS installation."""
    node = SimpleNamespace(callback=None)
    node.create_subscription = lambda kind, name, callback, profile: setattr(
        node, "callback", callback
    )
    node.destroy_node = lambda: None
    over = threading.Event()

    class Context:
        def init(self):
            pass

        def ok(self):
            return not over.is_set()

        def shutdown(self):
            over.set()

    class Executor:
        def __init__(self, context):
            pass

        def add_node(self, node):
            pass

        def spin(self):
            over.wait(60)

        def shutdown(self):
            over.set()

    modules = {name: ModuleType(name) for name in ("rclpy", "rclpy.executors", "rclpy.qos")}
    modules["rclpy"].Context, modules["rclpy"].create_node = Context, lambda *_, **__: node
    modules["rclpy.executors"].SingleThreadedExecutor = Executor
    modules["rclpy.qos"].qos_profile_sensor_data = None
    modules["sensor_msgs.msg"] = ModuleType("sensor_msgs.msg")
    modules["sensor_msgs.msg"].JointState = object
    for name, module in modules.items():
        monkeypatch.setitem(sys.modules, name, module)
    return node


def test_a_topic_that_falls_silent_is_a_fault(topic):
    stream = RosStream("/joint_states", ("a",), RATE)

    def publish():
        for k in range(25):
            stamp = SimpleNamespace(sec=7, nanosec=round(1e9 * k / RATE))
            topic.callback(
                SimpleNamespace(
                    header=SimpleNamespace(stamp=stamp),
                    name=["a"],
                    position=[0.0],
                    velocity=[0.0],
                    effort=[0.0],
                )
            )
            time.sleep(1 / RATE)

    threading.Thread(target=publish, daemon=True).start()
    session, _, silences = heard(stream, seconds=1.2)
    assert session.samples == 25
    assert silences == 1
    assert session.state.startswith("fault: no samples")


def test_a_pause_of_a_played_log_is_a_fault():
    t = np.concatenate([np.arange(0, 0.2, 1 / RATE), np.arange(0.8, 1.0, 1 / RATE)])
    still = np.zeros((len(t), 1))
    session, _, silences = heard(PlayedStream(Trace(("a",), t, still, still, still)))
    assert session.samples == len(t)
    assert silences == 1
    (fault,) = [f for f in session.faults() if f.end - f.start > 0.4]
    assert fault.start == pytest.approx(0.192)
    assert fault.end == pytest.approx(0.8, abs=0.03)
    assert session.state == "fault: no samples: the log is over"


class Stuck:
    """A stream whose reading blocks, against its own contract."""

    joint_names, rate = ("a",), RATE
    events = ()

    def __init__(self):
        self.given = 0

    def read(self, timeout):
        self.given += 1
        if self.given > 10:
            time.sleep(1.0)
            raise StreamClosed("gone", lost=True)
        time.sleep(1 / RATE)
        zero = np.zeros(1)
        return Sample(self.given / RATE, zero, zero, zero, time.monotonic_ns())

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass


def test_a_stream_that_blocks_is_a_fault_by_a_clock_of_its_own():
    session, _, silences = heard(Stuck(), seconds=10.0)
    assert silences == 1
    assert session.lost
    assert session.state.startswith("fault: no samples: nothing for 1")


def test_a_report_that_fails_during_silence_ends_the_session_with_its_error():
    """The thread of the clock would end, and silence would be taken for free."""

    def report(sample, answer):
        if np.isnan(sample.q).all():
            raise KeyError("told")

    text, into = piped()
    with pytest.raises(KeyError, match="told"):
        listen(LineStream(text, ("a",), RATE), AlwaysFree(), 5.0, report)
    os.close(into)
    text.close()


def test_an_input_that_has_ended_is_not_free():
    text, into = piped()
    os.write(into, b"1,0,0,0\n1.008,0,0,0\n")
    os.close(into)
    session = listen(LineStream(text, ("a",), RATE), AlwaysFree())
    assert session.state == "fault: no samples: the input has ended"
    assert session.faults() == []
    text.close()


class Named(AlwaysFree):
    """A monitor that calls each sample a fault."""

    def step(self, t, q, qd, current):
        return Answer("fault", False, 0.0, "time stands still")


def test_where_the_clock_of_the_robot_stands_still_a_fault_has_its_length():
    text, into = piped()

    def write():
        for _ in range(50):
            os.write(into, b"7,0,0,0\n")
            time.sleep(1 / RATE)
        os.close(into)

    threading.Thread(target=write, daemon=True).start()
    session = listen(LineStream(text, ("a",), RATE), Named())
    (span,) = session.spans.of("fault")
    assert span.start == 7
    assert 0.5 * 49 / RATE < span.end - span.start < 49 / RATE + 10 * BUSY
    text.close()


def test_a_collision_before_the_clock_begins_anew_is_kept():
    """The fault's time lies before the collision's: it looked as if it had begun just then."""
    spans = Spans()
    for t in np.arange(20, 21, 0.008):
        spans.add(t, Answer("collision", True, 2.0, ""))
    spans.add(0.0, Answer("fault", False, 0.0, "time"))
    spans.add(0.008, Answer("fault", False, 0.0, "time"))
    found = [(span.state, span.start, span.end) for span in spans.found]
    assert found == [("collision", 20, pytest.approx(20.992)), ("fault", 0, 0.008)]


class Alarmed(AlwaysFree):
    """A monitor whose alarm is up."""

    def step(self, t, q, qd, current):
        return Answer("collision", True, 2.0, "")


def test_a_collision_stays_one_when_the_robot_falls_silent():
    with Peer(stays_silent) as peer, stream_of(peer) as stream:
        said = []
        session = listen(stream, Alarmed(), 1.0, lambda _, answer: said.append(answer))
    assert said[-1].state == "collision"
    assert said[-1].reason.startswith("no samples")
    assert session.faults()[-1].reason.startswith("no samples")
