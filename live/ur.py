"""A Universal Robots arm, read by RTDE; nothing is ever written to the robot but the handshake."""

from __future__ import annotations

import socket
import struct
import time

import numpy as np

from tauguard.live import rtde
from tauguard.live.stream import Closing, Sample, StreamClosed

#: Joints of every UR arm by the names of UR's own ROS driver, as ``datasets.columns`` has them.
UR_JOINTS = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
#: What is asked of the controller, and the types that it has to answer.
VARIABLES = {
    "timestamp": "DOUBLE",
    "actual_q": "VECTOR6D",
    "actual_qd": "VECTOR6D",
    "actual_current": "VECTOR6D",
}
HANDSHAKE = 3.0  # [s] for each answer of the handshake
#: Controllers that send 500 samples a second (e-Series, major version 5 and up); older: 125.
E_SERIES = 5
#: Events of a connection that are kept; a robot that is lost every second has more in an hour.
MOST_EVENTS = 1000


class UrStream(Closing):
    """Joint positions, velocities and currents of a UR arm.

    Args:
        host: name or address of the controller.
        port: RTDE's.
        rate: samples a second to ask for (default: what the controller can give).
        reconnect: seconds to go on trying after the connection broke; 0: give up at once.

    Raises:
        ConnectionError: no answer, another protocol version, or variables that the controller does
            not have: one line that says which.
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
        self._socket: socket.socket | None = None
        self._open()

    @property
    def joint_names(self) -> tuple[str, ...]:
        """UR's own names."""
        return UR_JOINTS

    @property
    def rate(self) -> float:
        """Samples a second that were asked for."""
        return self._rate

    def read(self, timeout: float) -> Sample | None:
        """The next sample, or None if none came within ``timeout`` seconds.

        A broken connection is opened again for ``reconnect`` seconds, and ``events`` says so.

        Raises:
            StreamClosed: the connection broke and could not be opened again.
        """
        deadline = time.monotonic() + timeout
        while True:
            try:
                found = self._packet(deadline)
                if found is None:
                    return None
                if found.kind == rtde.DATA_PACKAGE:
                    return self._sample(found.payload)
            except (OSError, ValueError) as error:
                self._again(error)
                return None
            if found.kind == rtde.TEXT_MESSAGE:
                self._note(f"the controller says: {rtde.read_text(found.payload)!r}")

    def close(self) -> None:
        """Let go of the connection."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    # -- the connection ---------------------------------------------------------------------------

    def _open(self) -> None:
        try:
            self._socket = socket.create_connection((self.host, self.port), timeout=HANDSHAKE)
        except OSError as error:
            raise ConnectionError(
                f"{self.host}:{self.port} does not answer ({error.strerror or error}): is the "
                "robot on, and RTDE enabled in its security settings?"
            ) from None
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._reader = rtde.PacketReader()
        try:
            self._handshake()
        except (OSError, ValueError, struct.error) as error:
            self.close()
            if isinstance(error, ConnectionError):
                raise
            raise ConnectionError(
                f"{self.host}:{self.port} does not speak RTDE version {rtde.VERSION} ({error})"
            ) from None

    def _handshake(self) -> None:
        answer = self._ask(rtde.REQUEST_PROTOCOL_VERSION, struct.pack(">H", rtde.VERSION))
        if answer[:1] != b"\x01":
            raise ConnectionError(
                f"{self.host}:{self.port} refuses RTDE version {rtde.VERSION}: its software is "
                "older than 3.4; update the controller"
            )
        major = struct.unpack_from(">I", self._ask(rtde.GET_URCONTROL_VERSION))[0]
        self._rate = self._asked or (500.0 if major >= E_SERIES else 125.0)
        names = ",".join(VARIABLES).encode()
        answer = self._ask(rtde.SETUP_OUTPUTS, struct.pack(">d", self._rate) + names)
        types = tuple(answer[1:].decode("ascii", "replace").split(","))
        if types != tuple(VARIABLES.values()):
            wrong = [
                f"{name} ({got})"
                for (name, want), got in zip(VARIABLES.items(), types, strict=False)
                if want != got
            ] or ["no answer that can be read"]
            raise ConnectionError(
                f"{self.host}:{self.port} does not give {', '.join(wrong)}: expected a UR "
                "controller with software 3.4 or later"
            )
        self._recipe = answer[0]
        self._layout = rtde.Recipe(answer[0], types).layout
        if self._ask(rtde.START)[:1] != b"\x01":
            raise ConnectionError(f"{self.host}:{self.port} does not start its data")

    def _ask(self, kind: int, payload: bytes = b"") -> bytes:
        """Send one request and wait for the answer of its kind."""
        assert self._socket is not None
        self._socket.sendall(rtde.packet(kind, payload))
        deadline = time.monotonic() + HANDSHAKE
        while True:
            found = self._packet(deadline)
            if found is None:
                raise ValueError("no answer to the handshake")
            if found.kind == kind:
                return found.payload

    def _packet(self, deadline: float) -> rtde.Packet | None:
        """The next packet, None at the deadline.

        Raises:
            OSError: the connection is broken.
        """
        while (found := self._reader.next()) is None:
            if self._socket is None:
                raise ConnectionResetError("closed")
            # Look once more after the deadline: this program may have been kept from running.
            self._socket.settimeout(max(0.0, deadline - time.monotonic()))
            try:
                data = self._socket.recv(65536)
            except (TimeoutError, BlockingIOError):
                return None
            if not data:
                raise ConnectionResetError("the robot closed the connection")
            self._reader.feed(data)
        return found

    def _again(self, error: Exception) -> None:
        """Open the connection again, or give up.

        An ``OSError`` broke it; any other error is of a packet that cannot be read, and the
        connection was dropped here.
        """
        lost = isinstance(error, OSError)
        began = time.monotonic()
        self.close()
        while time.monotonic() - began < self.reconnect:
            try:
                self._open()
            except ConnectionError:
                time.sleep(0.2)
                continue
            what = "connection lost" if lost else "connection begun anew"
            self._note(f"{what} ({error}), back after {time.monotonic() - began:.1f} s")
            return
        what = "connection lost" if lost else "connection given up"
        raise StreamClosed(f"{self.host}:{self.port}: {what} ({error})")

    def _sample(self, payload: bytes) -> Sample:
        arrived = time.monotonic_ns()
        if len(payload) != self._layout.size or payload[0] != self._recipe:
            raise ValueError(
                f"a data packet of {len(payload)} bytes, expected {self._layout.size} of recipe "
                f"{self._recipe}"
            )
        values = rtde.read_doubles(payload)
        t = float(values[0])
        passed, self._last = t - self._last, t
        if np.isfinite(passed) and passed * self._rate > 1.5:
            self._note(f"{passed * self._rate - 1:.0f} samples lost before {t:.3f} s")
        return Sample(t, values[1:7], values[7:13], values[13:19], arrived)

    def _note(self, event: str) -> None:
        """Keep an event, a bounded number of them."""
        if len(self.events) < MOST_EVENTS:
            self.events.append(event[:200])
        elif len(self.events) == MOST_EVENTS:
            self.events.append("more events are not listed")
