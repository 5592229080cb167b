"""Peers of a stream: an RTDE controller that does as a test says, and a pipe."""

import contextlib
import os
import socket
import struct
import threading
import time

from tauguard.live import rtde, ur

#: Samples a second.
RATE = 125.0


class Peer:
    """A server that answers the handshake and then does as it likes."""

    def __init__(self, *manners):
        """``manners``: what to do with the first client, the second, ...; the last for all more."""
        self._manners, self._over = manners, threading.Event()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        self.clients = 0
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self):
        while not self._over.is_set():
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            manner = self._manners[min(self.clients, len(self._manners) - 1)]
            self.clients += 1
            threading.Thread(target=self._serve, args=(manner, client), daemon=True).start()

    def _serve(self, manner, client):
        with client, contextlib.suppress(OSError):
            manner(self, client)

    def shake_hands(self, client):
        reader, types = rtde.PacketReader(), ",".join(ur.VARIABLES.values()).encode()
        answers = {
            rtde.REQUEST_PROTOCOL_VERSION: b"\x01",
            rtde.GET_URCONTROL_VERSION: struct.pack(">4I", 3, 0, 0, 0),
            rtde.SETUP_OUTPUTS: b"\x01" + types,
            rtde.START: b"\x01",
        }
        while True:
            reader.feed(client.recv(4096))
            while (request := reader.next()) is not None:
                client.sendall(rtde.packet(request.kind, answers[request.kind]))
                if request.kind == rtde.START:
                    return

    def send_samples(self, client, count=25, begin=0.0):
        recipe = rtde.Recipe(1, tuple(ur.VARIABLES.values()))
        for k in range(count):
            client.sendall(recipe.pack([begin + k / RATE, *[0.1] * 18]))
            time.sleep(1 / RATE)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._over.set()
        self._listener.close()


def piped():
    """A pipe: the file to read, and the descriptor to write to."""
    out, into = os.pipe()
    return open(out), into
