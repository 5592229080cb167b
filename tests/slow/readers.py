"""Reads a file of each format through the function that a user calls."""

from __future__ import annotations

import contextlib
import socket
import threading
from pathlib import Path
from typing import Any

from slow.originals import JOINTS
from tauguard.arrays import Array


def signals(trace: Any) -> list[Array]:
    """The measured signals of a trace."""
    return [trace.t, trace.q, trace.qd, trace.current]


def csv(path: Path) -> Any:
    """Measured signals of a table whose columns are given."""
    from tauguard.datasets import ColumnMap, read_log

    columns = ColumnMap(t=0, q=(1, 2), qd=(3, 4), current=(5, 6))
    return signals(read_log(path, columns).trace)


def log(path: Path) -> Any:
    """Measured signals of a log whose format is detected."""
    from tauguard.datasets import read_log

    return signals(read_log(path).trace)


def recording(path: Path) -> Any:
    """A recording of tauguard, all of it."""
    from tauguard.traces import read_mcap

    return read_mcap(path)


def columns(path: Path) -> Any:
    """A map of columns."""
    from tauguard.datasets.columns import column_map

    return column_map(str(path))


def robot(path: Path) -> Any:
    """Joints and mass of a robot file."""
    from tauguard.models.nominal import pin_model

    model = pin_model(path)
    return model.njoints - 1, sum(inertia.mass for inertia in model.inertias)


def arm(path: Path) -> Any:
    """A robot's numbers."""
    from tauguard.models import Robot

    return Robot.from_toml(path)


def configuration(path: Path) -> Any:
    """A dataset's configuration."""
    from tauguard.datasets.configuration import load_configuration

    return load_configuration(path)


def model(path: Path) -> Any:
    """A trained detector."""
    from tauguard.detectors import load_model

    return load_model(path)


def lines(path: Path) -> Any:
    """Samples of the standard input."""
    from tauguard.live.lines import LineStream
    from tauguard.live.stream import StreamClosed

    found = []
    with open(path) as stream, LineStream(stream, JOINTS, 100.0) as source:
        try:
            while (sample := source.read(1.0)) is not None:
                found.append([sample.t, *sample.q, *sample.qd, *sample.current])
        except StreamClosed as closed:
            if closed.lost:  # a line without an end
                raise ValueError(str(closed)) from None
    return found


def rtde(path: Path) -> Any:
    """Samples from a server that sends these bytes, whatever it is asked."""
    from tauguard.live import UrStream
    from tauguard.live.stream import StreamClosed

    found = []
    listener = socket.create_server(("127.0.0.1", 0))
    sender = threading.Thread(target=_send, args=(listener, path.read_bytes()), daemon=True)
    sender.start()
    try:
        with UrStream("127.0.0.1", listener.getsockname()[1], 125.0, reconnect=0) as source:
            while (sample := source.read(1.0)) is not None:
                found.append([sample.t, *sample.q, *sample.qd, *sample.current])
    except StreamClosed:
        pass
    finally:
        sender.join()
        listener.close()
    return found


def _send(listener: socket.socket, data: bytes) -> None:
    """Send everything to the first client, then read until it closes."""
    client, _ = listener.accept()
    with client, contextlib.suppress(OSError):
        client.settimeout(20.0)
        client.sendall(data)
        client.shutdown(socket.SHUT_WR)
        while client.recv(4096):
            pass


def dataset(path: Path) -> Any:
    """The dataset in which the damaged file replaces a shard, a manifest or the head."""
    from tauguard.datasets.reader import read

    folder = path.parent / "dataset"
    return [(signals(trace), dict(trace.attachments)) for trace in read(folder)]
