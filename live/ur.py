"""Read a Universal Robots arm by RTDE; nothing but the handshake is sent to the robot."""

from __future__ import annotations

import socket
import struct
import threading
import time

import numpy as np

from tauguard.arrays import Array
from tauguard.findings import ArgumentError
from tauguard.live import rtde
from tauguard.live.stream import Closing, Sample, StreamClosed, add_event
from tauguard.traces.trace import UR_JOINTS

#: The requested variables, and their types, which the controller's answer must confirm.
VARIABLES = {
    "timestamp": "DOUBLE",
    "actual_q": "VECTOR6D",
    "actual_qd": "VECTOR6D",
    "actual_current": "VECTOR6D",
}
#: Time limit for connection and handshake together [s].
HANDSHAKE = 5.0
#: Time without a data packet after which a connection is given up [s], because a robot that loses
#: power does not close it.
NO_DATA = 5.0
#: Seconds between attempts to connect again.
RETRY = 0.2
#: Lowest major version of controllers that send 500 samples per second (e-Series); others send 125.
E_SERIES = 5


class UrStream(Closing):
    """Joint positions, velocities and currents of a UR arm.

    Args:
        host: name or address of the controller.
        port: the port of RTDE.
        rate: requested sample rate [Hz] (default: the controller's highest).
        reconnect: how long to try to reconnect after the connection broke [s]; 0: not at all.

    Raises:
        ConnectionError: no answer, another protocol version, or variables that the controller does
            not have (named in the message).
    """

    def __init__(
        self,
        host: str,
        port: int = rtde.PORT,
        rate: float | None = None,
        reconnect: float = 10.0,
    ) -> None:
        """Connect and start the data; see the class."""
        self.host, self.port, self.reconnect = host, port, reconnect
        self.events: list[str] = []
        self._asked = rate
        self._last = np.nan
        self._lost = ""
        self._attempt: _Reconnection | None = None
        self._connection: _Connection | None = _Connection(host, port, rate, HANDSHAKE)
        self.joint_names, self.rate = UR_JOINTS, self._connection.rate

    def read(self, timeout: float) -> Sample | None:
        """The next sample, or None if none came within ``timeout`` seconds.

        A broken connection is reopened in the background; the method returns None meanwhile.

        Raises:
            StreamClosed: the connection broke, and was not back after ``reconnect`` seconds.
        """
        deadline = time.monotonic() + timeout
        connection = self._connection or self._reconnected(timeout)
        if connection is None:
            return None
        try:
            while (found := connection.packet(deadline)) is not None:
                if found.kind == rtde.DATA_PACKAGE:
                    return self._sample(connection.values(found.payload))
                if found.kind == rtde.TEXT_MESSAGE:
                    message = rtde.read_text(found.payload)
                    add_event(self.events, f"the controller says: {message!r}")
                if time.monotonic() >= deadline:
                    break
            if time.monotonic() > connection.data_due:
                raise TimeoutError(f"no data for {NO_DATA:g} s")
        except (OSError, ValueError) as error:
            self._lose(error)
        return None

    def close(self) -> None:
        """Close the connection, and end attempts to open it again."""
        if self._attempt is not None:
            self._attempt.stop()
        if self._connection is not None:
            self._connection.close()
        self._attempt = self._connection = None

    def _lose(self, error: Exception) -> None:
        """Drop the connection and begin to open it again.

        An ``OSError`` means that the connection broke. Any other error means that a packet could
        not be read; then this side closes the connection.

        Raises:
            StreamClosed: ``reconnect`` is 0.
        """
        self.close()
        broken = isinstance(error, OSError)
        self._lost = f"connection {'lost' if broken else 'given up'} ({error})"
        if not self.reconnect > 0:
            raise StreamClosed(f"{self.host}:{self.port}: {self._lost}", lost=True)
        self._attempt = _Reconnection(self.host, self.port, self._asked, self.reconnect)

    def _reconnected(self, timeout: float) -> _Connection | None:
        """The new connection, or None if there is none after ``timeout`` seconds."""
        attempt = self._attempt
        if attempt is None:
            raise StreamClosed(f"{self.host}:{self.port}: closed")
        self._connection = attempt.wait(timeout)
        if self._connection is not None:
            self._attempt = None
            seconds = time.monotonic() - attempt.began
            add_event(self.events, f"{self._lost}, back after {seconds:.1f} s")
        elif attempt.over:
            self.close()
            raise StreamClosed(f"{self.host}:{self.port}: {self._lost}", lost=True)
        return self._connection

    def _sample(self, values: Array) -> Sample:
        arrived = time.monotonic_ns()
        t = float(values[0])
        passed, self._last = t - self._last, t
        if np.isfinite(passed) and passed * self.rate > 1.5:
            lost = f"{passed * self.rate - 1:.0f} samples lost before {t:.3f} s"
            add_event(self.events, lost)
        return Sample(t, values[1:7], values[7:13], values[13:19], arrived)


class _Connection:
    """An RTDE connection on which the controller sends data.

    Raises:
        ConnectionError: as for :class:`UrStream`.
    """

    def __init__(self, host: str, port: int, rate: float | None, within: float) -> None:
        deadline = time.monotonic() + within
        self._where = f"{host}:{port}"
        try:
            self._socket = _connected(host, port, deadline)
        except OSError as error:
            raise ConnectionError(
                f"{self._where} does not answer ({error.strerror or error}): is the "
                "robot on, and RTDE enabled in its security settings?"
            ) from None
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._reader = rtde.PacketReader()
        try:
            self._handshake(rate, deadline)
        except (OSError, ValueError, struct.error) as error:
            self.close()
            if isinstance(error, ConnectionError):
                raise
            raise ConnectionError(
                f"{self._where} does not speak RTDE version {rtde.VERSION} ({error})"
            ) from None
        self.data_due = time.monotonic() + NO_DATA  #: time of giving up without data

    def _handshake(self, rate: float | None, deadline: float) -> None:
        version = struct.pack(">H", rtde.VERSION)
        answer = self._ask(deadline, rtde.REQUEST_PROTOCOL_VERSION, version)
        if answer[:1] != b"\x01":
            raise ConnectionError(
                f"{self._where} refuses RTDE version {rtde.VERSION}: its software is "
                "older than 3.4; update the controller"
            )
        major = struct.unpack_from(">I", self._ask(deadline, rtde.GET_URCONTROL_VERSION))[0]
        self.rate = rate or (500.0 if major >= E_SERIES else 125.0)
        names = ",".join(VARIABLES).encode()
        answer = self._ask(deadline, rtde.SETUP_OUTPUTS, struct.pack(">d", self.rate) + names)
        types = tuple(answer[1:].decode("ascii", "replace").split(","))
        if types != tuple(VARIABLES.values()):
            wrong = [
                f"{name} ({got})"
                for (name, want), got in zip(VARIABLES.items(), types, strict=False)
                if want != got
            ] or ["no answer that can be read"]
            raise ConnectionError(
                f"{self._where} does not give {', '.join(wrong)}: expected a UR "
                "controller with software 3.4 or later"
            )
        self._recipe = answer[0]
        self._layout = rtde.Recipe(answer[0], types).layout
        if self._ask(deadline, rtde.START)[:1] != b"\x01":
            raise ConnectionError(f"{self._where} does not start its data")

    def _ask(self, deadline: float, kind: int, payload: bytes = b"") -> bytes:
        """Send one request and wait for the answer of the same type."""
        self._socket.sendall(rtde.packet(kind, payload))
        while (found := self.packet(deadline)) is not None and time.monotonic() < deadline:
            if found.kind == kind:
                return found.payload
        raise ArgumentError("no answer to the handshake")

    def packet(self, deadline: float) -> rtde.Packet | None:
        """The next packet, or None if there is none at the deadline.

        Raises:
            OSError: the connection is broken.
            ArgumentError: the other side does not speak RTDE.
        """
        left = deadline - time.monotonic()
        while (found := self._reader.next()) is None:
            # Read once even after the deadline: the system may have suspended this program.
            self._socket.settimeout(max(0.0, left))
            try:
                data = self._socket.recv(65536)
            except (TimeoutError, BlockingIOError):
                return None
            if not data:
                raise ConnectionResetError("the robot closed the connection")
            self._reader.feed(data)
            if left < 0:
                return self._reader.next()
            left = deadline - time.monotonic()
        return found

    def values(self, payload: bytes) -> Array:
        """The numbers in a data packet: time, q, qd, currents.

        Raises:
            ArgumentError: a packet of another recipe or size.
        """
        if len(payload) != self._layout.size or payload[0] != self._recipe:
            raise ArgumentError(
                f"a data packet of {len(payload)} bytes, expected {self._layout.size} of recipe "
                f"{self._recipe}"
            )
        self.data_due = time.monotonic() + NO_DATA
        return np.frombuffer(payload, ">f8", offset=1).astype(np.float64)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


def _connected(host: str, port: int, deadline: float) -> socket.socket:
    """Connect to the host's first address that answers; all attempts share the time limit."""
    found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    addresses = [(str(address[0]), port) for *_, address in found]
    for waiting in range(len(addresses), 0, -1):
        left = max(deadline - time.monotonic(), 0.001) / waiting
        try:
            return socket.create_connection(addresses[-waiting], timeout=left)
        except OSError:
            if waiting == 1:
                raise
    raise OSError("no address")


class _Reconnection:
    """Attempts to reconnect, in a separate thread, so that reading keeps its deadlines."""

    def __init__(self, host: str, port: int, rate: float | None, within: float) -> None:
        self.began = time.monotonic()
        self._until = self.began + within
        self._where = (host, port, rate)
        self._found: _Connection | None = None
        self._lock, self._done, self._stop = threading.Lock(), threading.Event(), threading.Event()
        threading.Thread(target=self._run, daemon=True).start()

    @property
    def over(self) -> bool:
        """Whether the time limit has passed; the thread may still wait for an answer."""
        return self._done.is_set() or time.monotonic() >= self._until

    def wait(self, timeout: float) -> _Connection | None:
        """The connection, or None if there is none after ``timeout`` seconds."""
        self._done.wait(max(0.0, min(timeout, self._until - time.monotonic())))
        with self._lock:
            return self._found

    def stop(self) -> None:
        """End the attempts and close a connection that was not taken."""
        with self._lock:
            self._stop.set()
            if self._found is not None:
                self._found.close()

    def _run(self) -> None:
        while not self._stop.is_set() and (left := self._until - time.monotonic()) > 0:
            try:
                found = _Connection(*self._where, min(HANDSHAKE, left))
            except ConnectionError:
                self._stop.wait(RETRY)
                continue
            with self._lock:
                self._found = found
                if self._stop.is_set():
                    found.close()
            break
        self._done.set()
