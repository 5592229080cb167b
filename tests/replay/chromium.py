"""Headless Chromium, asked for pictures of a page by the DevTools protocol over its pipe."""

import base64
import itertools
import json
import os
import shutil
import subprocess

PROGRAM = shutil.which("chromium") or shutil.which("chromium-browser")
#: Drawn in software, and without a word to other hosts.
FLAGS = [
    "--headless",
    "--remote-debugging-pipe",
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--window-size=800,600",
]


class Page:
    """One page of a browser of its own."""

    def __init__(self, address, profile):
        to_browser, self._send = os.pipe()
        self._receive, from_browser = os.pipe()
        # The browser reads from descriptor 3 and writes to descriptor 4.
        code = f'exec 3<&{to_browser} 4>&{from_browser}; exec "$0" "$@"'
        command = ["bash", "-c", code, PROGRAM, *FLAGS, f"--user-data-dir={profile}"]
        self._browser = subprocess.Popen(
            command, pass_fds=(to_browser, from_browser), stderr=subprocess.DEVNULL
        )
        os.close(to_browser)
        os.close(from_browser)
        self._buffer, self._ids = b"", itertools.count(1)
        target = self._ask("Target.createTarget", url=address)["targetId"]
        attached = self._ask("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]

    def picture(self):
        """The page as it is now: the bytes of a PNG file."""
        return base64.b64decode(self._ask("Page.captureScreenshot", self._session)["data"])

    def close(self):
        """End the browser."""
        self._browser.kill()
        self._browser.wait()
        os.close(self._send)
        os.close(self._receive)

    def _ask(self, method, session=None, **parameters):
        number = next(self._ids)
        message = {"id": number, "method": method, "params": parameters}
        if session:
            message["sessionId"] = session
        os.write(self._send, json.dumps(message).encode() + b"\0")
        while True:
            answer = json.loads(self._next())
            if answer.get("id") == number:
                return answer["result"]

    def _next(self):
        while b"\0" not in self._buffer:
            part = os.read(self._receive, 1 << 16)
            if not part:
                raise ConnectionError("Chromium has ended")
            self._buffer += part
        message, _, self._buffer = self._buffer.partition(b"\0")
        return message
