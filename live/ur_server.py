"""An RTDE server on this machine that replays a log in place of a robot.

It answers the requests of a client that reads as a UR controller does: handshake, recipe of output
variables, start and pause. Inputs are refused. Its clock begins with the first start. A client
that starts later receives the log from the present time on, as it would from a robot.
"""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
import time

import numpy as np

from tauguard.findings import ArgumentError
from tauguard.live import rtde
from tauguard.live.packets import Packets
from tauguard.live.stream import Closing

HOST = "127.0.0.1"
#: Output variables: type, and field of :class:`Packets` with the value ("": the value is 0).
OUTPUTS = {
    "timestamp": ("DOUBLE", "t"),
    "actual_q": ("VECTOR6D", "q"),
    "actual_qd": ("VECTOR6D", "qd"),
    "actual_current": ("VECTOR6D", "current"),
    "target_q": ("VECTOR6D", "q"),
    "target_qd": ("VECTOR6D", "qd"),
    "robot_mode": ("INT32", ""),
    "safety_mode": ("INT32", ""),
    "runtime_state": ("UINT32", ""),
}


class UrServer(Closing):
    """Sends packets to every client that connects, in real time, on 127.0.0.1 (``host``).

    Args:
        packets: the packets to send, of six joints.
        port: the port to serve; 0: any free port (see :attr:`port`).
        version: the only protocol version that is accepted.
        controller: major version of the controller; 5 and up sends up to 500 samples per second.

    Raises:
        ArgumentError: the number of joints is not six, or the port cannot be opened.
    """

    host = HOST

    def __init__(
        self,
        packets: Packets,
        port: int = rtde.PORT,
        *,
        version: int = rtde.VERSION,
        controller: int | None = None,
    ) -> None:
        """Open the port; :meth:`start` serves."""
        if packets.q.shape[1] != 6:
            raise ArgumentError(f"{packets.q.shape[1]} joints: RTDE carries six")
        self.packets, self.version = packets, version
        spacing = float(np.median(np.diff(packets.t))) if len(packets.t) > 1 else 0.008
        self.controller = controller or (5 if spacing < 4e-3 else 3)
        self._listener = socket.socket()
        self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._listener.bind((HOST, port))
        except OSError as error:
            self._listener.close()
            raise ArgumentError(f"port {port} on {HOST}: {error.strerror}") from None
        self._listener.listen()
        self.sent = 0  #: data packets to all clients together
        self._began: float | None = None
        self._lock = threading.Lock()
        self._over = threading.Event()
        self._clients: list[socket.socket] = []

    @property
    def port(self) -> int:
        """The port that is served."""
        return int(self._listener.getsockname()[1])

    def start(self) -> UrServer:
        """Serve in the background; returns this server."""
        threading.Thread(target=self._accept, daemon=True).start()
        return self

    def wait(self, timeout: float | None = None) -> bool:
        """Wait for the end of the log. Returns whether it was reached."""
        return self._over.wait(timeout)

    def close(self) -> None:
        """Stop serving and close every connection."""
        self._over.set()
        self._listener.close()
        with self._lock:
            for client in self._clients:
                with contextlib.suppress(OSError):
                    client.shutdown(socket.SHUT_RDWR)
                client.close()
            self._clients.clear()

    def __enter__(self) -> UrServer:
        """The server, serving."""
        return self.start()

    # -- one client -------------------------------------------------------------------------------

    def _accept(self) -> None:
        while not self._over.is_set():
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            with self._lock:
                self._clients.append(client)
            threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        session = _Session(self, client)
        with contextlib.suppress(OSError, ValueError, struct.error), client:
            session.run()

    def begin(self) -> float:
        """Start the clock if it does not run. Returns the seconds since its start."""
        with self._lock:
            if self._began is None:
                self._began = time.monotonic()
                return 0.0
        return self.clock()

    def clock(self) -> float:
        """Seconds since the first client started the data; 0 before."""
        return 0.0 if self._began is None else time.monotonic() - self._began


class _Session:
    """One connection: answers requests, and sends data while started."""

    def __init__(self, server: UrServer, client: socket.socket) -> None:
        self.server, self.client = server, client
        self.reader = rtde.PacketReader()
        self.fields: list[str] = []
        self.recipe: rtde.Recipe | None = None
        self.step = 1
        self.running = False
        self.row = 0

    def run(self) -> None:
        """Answer until the client disconnects or the log is over."""
        while not self.server._over.is_set():
            wait = self._send_due() if self.running else 0.5
            self.client.settimeout(max(wait, 1e-4))
            try:
                data = self.client.recv(4096)
            except TimeoutError:
                continue
            if not data:
                return
            self.reader.feed(data)
            while (request := self.reader.next()) is not None:
                self._answer(request)

    def _send_due(self) -> float:
        """Send the packets that are due. Returns the seconds until the next one is due."""
        packets, now = self.server.packets, self.server.clock()
        while self.row < len(packets.due) and packets.due[self.row] <= now:
            if self.row % self.step == 0:
                self._send(self.row)
            self.row += 1
        if self.row >= len(packets.due):
            self.server._over.set()
            return 0.0
        return float(packets.due[self.row] - self.server.clock())

    def _send(self, row: int) -> None:
        assert self.recipe is not None
        values: list[float] = []
        for name, kind in zip(self.fields, self.recipe.types, strict=True):
            if name:
                values.extend(np.atleast_1d(getattr(self.server.packets, name)[row]).tolist())
            else:
                values.extend([0] * (6 if "6" in kind else 1))
        self.client.sendall(self.recipe.pack(values))
        self.server.sent += 1

    def _answer(self, request: rtde.Packet) -> None:
        kind, payload = request.kind, request.payload
        if kind == rtde.REQUEST_PROTOCOL_VERSION:
            accepted = struct.unpack(">H", payload)[0] == self.server.version
            answer = struct.pack(">?", accepted)
        elif kind == rtde.GET_URCONTROL_VERSION:
            answer = struct.pack(">4I", self.server.controller, 0, 0, 0)
        elif kind == rtde.SETUP_OUTPUTS:
            answer = self._set_up(payload)
        elif kind == rtde.SETUP_INPUTS:
            self.client.sendall(rtde.text_message("play-ur", "inputs are refused", 1))
            names = payload.decode("ascii", "replace").split(",")
            answer = b"\x00" + ",".join("NOT_FOUND" for _ in names).encode()
        elif kind in (rtde.START, rtde.PAUSE):
            self.running = kind == rtde.START and self.recipe is not None
            answer = struct.pack(">?", self.running or kind == rtde.PAUSE)
            if self.running:
                self.row = int(np.searchsorted(self.server.packets.due, self.server.begin()))
        else:
            return
        self.client.sendall(rtde.packet(kind, answer))

    def _set_up(self, payload: bytes) -> bytes:
        rate = struct.unpack_from(">d", payload)[0]
        # Common clients end the list with a comma, which controllers accept.
        names = payload[8:].decode("ascii", "replace").rstrip(",").split(",")
        known = [OUTPUTS.get(name, ("NOT_FOUND", "")) for name in names]
        types = tuple(kind for kind, _ in known)
        if "NOT_FOUND" in types:
            return b"\x00" + ",".join(types).encode()
        t = self.server.packets.t
        own = 1 / float(np.median(np.diff(t))) if len(t) > 1 else 125.0
        self.step = max(1, round(own / rate)) if rate > 0 else 1
        self.fields = [field for _, field in known]
        self.recipe = rtde.Recipe(1, types)
        return b"\x01" + ",".join(types).encode()
