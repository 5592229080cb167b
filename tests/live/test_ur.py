"""The RTDE client and server: the protocol as published, a log played and read back."""

import re
import socket
import struct
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from tauguard.live import PlayedStream, StreamClosed, UrServer, UrStream, rtde
from tauguard.live.packets import FAULTS, Fault, Packets
from tauguard.traces.trace import Trace


def moving(seconds=0.4, rate=125.0):
    t = np.arange(0, seconds, 1 / rate)
    phase = 2 * np.pi * t[:, None] + np.arange(6)
    return Trace(
        tuple(f"j{i}" for i in range(6)),
        t,
        np.sin(phase),
        2 * np.pi * np.cos(phase),
        5 * np.sin(phase),
    )


def read_all(source):
    samples = []
    try:
        while (sample := source.read(2.0)) is not None:
            samples.append(sample)
    except StreamClosed:
        pass
    return samples


def read_on(source):
    while True:
        source.read(0.5)


def test_packets_are_those_of_the_published_guide():
    # The guide's example of a request: size 5, type V, protocol version 2; all big-endian.
    assert rtde.packet(ord("V"), struct.pack(">H", 2)) == b"\x00\x05V\x00\x02"
    recipe = rtde.Recipe(7, ("DOUBLE", "VECTOR6INT32"))
    sent = recipe.pack([1.5, 1, 2, 3, 4, 5, 6])
    assert sent[:4] == struct.pack(">HBB", 3 + 1 + 8 + 24, ord("U"), 7)
    assert struct.unpack(">d6i", sent[4:]) == (1.5, 1, 2, 3, 4, 5, 6)


def test_packets_come_out_of_pieces_of_any_size():
    reader = rtde.PacketReader()
    found = []
    for byte in rtde.packet(1, b"abc") + rtde.packet(2):
        reader.feed(bytes([byte]))
        while (whole := reader.next()) is not None:
            found.append((whole.kind, whole.payload))
    assert found == [(1, b"abc"), (2, b"")]


def test_a_log_arrives_as_it_was_sent():
    trace = moving()
    with (
        UrServer(Packets.of(trace), 0) as server,
        UrStream("127.0.0.1", server.port, reconnect=0) as source,
    ):
        assert source.rate == 125.0
        samples = read_all(source)
        assert source.events == []
    assert np.array_equal([s.t for s in samples], trace.t)
    assert np.array_equal([s.q for s in samples], trace.q)
    assert np.array_equal([s.qd for s in samples], trace.qd)
    assert np.array_equal([s.current for s in samples], trace.current)
    took = (samples[-1].arrived - samples[0].arrived) * 1e-9
    assert took == pytest.approx(trace.t[-1] - trace.t[0], abs=0.1)


def test_a_slower_client_gets_every_fourth_sample():
    trace = moving(rate=500.0)
    with (
        UrServer(Packets.of(trace), 0) as server,
        UrStream("127.0.0.1", server.port, rate=125.0, reconnect=0) as source,
    ):
        samples = read_all(source)
    assert np.array_equal([s.t for s in samples], trace.t[::4])


def test_lost_packets_are_counted():
    packets = Fault("missing", 0.1, 0.08).apply(Packets.of(moving()))
    with (
        UrServer(packets, 0) as server,
        UrStream("127.0.0.1", server.port, reconnect=0) as source,
    ):
        read_all(source)
        assert source.events == ["10 samples lost before 0.184 s"]


def test_a_broken_connection_is_opened_again():
    trace = moving(1.5)
    with (
        UrServer(Packets.of(trace), 0) as server,
        UrStream("127.0.0.1", server.port, reconnect=5) as source,
    ):
        first = source.read(1.0)
        for client in server._clients:
            client.shutdown(socket.SHUT_RDWR)
        samples = []
        while len(samples) < 20:
            sample = source.read(0.5)
            samples += [sample] if sample else []
        assert any("connection lost" in event and "back after" in event for event in source.events)
    assert samples[-1].t > first.t


@pytest.mark.parametrize("reconnect", [0, 5])
def test_a_data_packet_of_another_size_is_no_lost_connection(reconnect):
    with (
        UrServer(Packets.of(moving(6.0)), 0) as server,
        UrStream("127.0.0.1", server.port, reconnect=reconnect) as source,
    ):
        assert source.read(1.0) is not None
        source._connection._reader.feed(rtde.packet(rtde.DATA_PACKAGE, b"\x01short"))
        said = "[(]a data packet of 6 bytes, expected 153 of recipe 1[)]"
        if reconnect:
            while not source.events:
                source.read(0.5)
            assert re.match(f"connection given up {said}, back after", source.events[0])
            assert source.read(1.0) is not None
        else:
            with pytest.raises(StreamClosed, match=f"connection given up {said}"):
                read_on(source)


def test_another_version_is_refused_in_one_line():
    with (
        UrServer(Packets.of(moving()), 0, version=1) as server,
        pytest.raises(ConnectionError, match="refuses RTDE version 2") as error,
    ):
        UrStream("127.0.0.1", server.port)
    assert "\n" not in str(error.value)


def test_nobody_there_is_said_at_once():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with pytest.raises(ConnectionError, match="does not answer"):
        UrStream("127.0.0.1", port)


def test_something_that_is_not_rtde_is_said():
    listener = socket.create_server(("127.0.0.1", 0))

    def babble():
        client, _ = listener.accept()
        with client:
            client.sendall(b"\x00\x01SSH-2.0-OpenSSH\r\n")
            time.sleep(0.3)

    threading.Thread(target=babble, daemon=True).start()
    with pytest.raises(ConnectionError, match="does not speak RTDE"):
        UrStream("127.0.0.1", listener.getsockname()[1])
    listener.close()


def test_a_played_trace_keeps_its_pace():
    trace = moving(0.2)
    source = PlayedStream(trace)
    began = time.monotonic()
    samples = read_all(source)
    assert time.monotonic() - began == pytest.approx(0.192, abs=0.05)
    assert np.array_equal([s.q for s in samples], trace.q)
    with pytest.raises(StreamClosed):
        source.read(0.0)


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_touches_only_its_own_seconds(name):
    packets = Packets.of(moving(2.0))
    faulty = Fault(name, 0.5, 0.25).apply(packets)
    outside = (packets.due < 0.5) | (packets.due >= 0.75)
    kept = (faulty.due < 0.5) | (faulty.due >= 0.75)
    for field in ("t", "q", "qd", "current"):
        assert np.array_equal(getattr(packets, field)[outside], getattr(faulty, field)[kept])
    same = len(faulty.due) == len(packets.due) and all(
        np.array_equal(getattr(packets, field), getattr(faulty, field))
        for field in ("due", "t", "q", "qd", "current")
    )
    assert not same


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("frozn@3", "there are frozen, stale"),
        ("frozen", "expected NAME@SECONDS"),
        ("frozen@-1", "0 or more"),
        ("frozen@1+0", "above 0"),
    ],
)
def test_bad_faults_are_named(text, said):
    with pytest.raises(ValueError, match=said):
        Fault.parse(text)


OUTSIDER = """
import rtde_receive, time
robot = rtde_receive.RTDEReceiveInterface(
    "127.0.0.1", 125.0, ["timestamp", "actual_q", "actual_qd", "actual_current"]
)
time.sleep(0.1)
print(robot.getTimestamp(), *robot.getActualQ(), *robot.getActualQd(), *robot.getActualCurrent())
robot.disconnect()
"""


def test_another_client_reads_the_same():
    pytest.importorskip("rtde_receive", reason="ur-rtde is not installed")
    trace = moving(4.0)
    try:
        server = UrServer(Packets.of(trace))  # its client knows no other port
    except ValueError as error:
        pytest.skip(str(error))
    with server:
        done = subprocess.run(
            [sys.executable, "-c", OUTSIDER], capture_output=True, text=True, timeout=60
        )
    t, *values = (float(word) for word in done.stdout.split()[-19:])
    row = int(np.argmin(np.abs(trace.t - t)))
    assert t == trace.t[row]
    assert np.array_equal(values, [*trace.q[row], *trace.qd[row], *trace.current[row]])
