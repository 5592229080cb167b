"""Show recordings in a browser: a server of their folder on 127.0.0.1, and rerun's web viewer.

The viewer is part of the rerun SDK, so it can read the SDK's files. Nothing is fetched from
other hosts.
"""

from __future__ import annotations

import contextlib
import http.client
import http.server
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

HOST = "127.0.0.1"  # the only address of both servers
PATIENCE = 20.0  # longest wait for the viewer [s]
#: Endings of the files that are served.
SERVED = (".rrd", ".html", ".png")
#: Content security policy: pages run no script, which could send data to another host, and load
#: only from this server. (The report's script runs only if its page is opened as a file.)
POLICY = (
    "default-src 'self' data:; script-src 'none'; style-src 'unsafe-inline'; form-action 'none'; "
    "base-uri 'none'"
)


class BrowserReplay:
    """Serves a folder's recordings and the viewer that shows them, until it is closed."""

    def __init__(self, folder: Path, port: int = 0) -> None:
        """Start both servers.

        Args:
            folder: holds ``.rrd`` files, and an ``index.html`` that links to ``open/NAME.rrd``.
            port: port of the folder's server; 0 for a free one.

        Raises:
            OSError: the port is in use, or the viewer did not start.
        """
        handler = partial(_Folder, directory=str(folder))
        try:
            self._files = _Server((HOST, port), handler)
        except OSError as error:
            raise OSError(f"port {port}: {error.strerror}; `port=0` takes a free one") from error
        self.address = f"http://{HOST}:{self._files.server_address[1]}"
        threading.Thread(target=self._files.serve_forever, daemon=True).start()
        viewer_port = _free_port()
        self._files.viewer = f"http://{HOST}:{viewer_port}"
        self._files.address = self.address
        try:
            self._viewer = _start_viewer(viewer_port, self.address)
        except OSError:
            self._close_files()
            raise

    def url(self, name: str) -> str:
        """The address of the recording ``name`` of the folder."""
        return _viewed(self._files.viewer, self.address, name)

    def wait(self) -> None:
        """Serve until the viewer ends or the user interrupts."""
        self._viewer.wait()

    def close(self) -> None:
        """Stop both servers."""
        _end(self._viewer)
        self._close_files()

    def _close_files(self) -> None:
        self._files.shutdown()
        self._files.server_close()

    def __enter__(self) -> BrowserReplay:
        """Return this object; the servers run already."""
        return self

    def __exit__(self, *_: object) -> None:
        """Stop both servers."""
        self.close()


class _Server(http.server.ThreadingHTTPServer):
    """The folder's server, with the viewer's address."""

    daemon_threads = True
    viewer = address = ""

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore the error of a browser that closes the connection early."""
        if not isinstance(sys.exception(), ConnectionError):
            super().handle_error(request, client_address)


class _Folder(http.server.SimpleHTTPRequestHandler):
    """Serve the folder's own files; ``open/NAME`` redirects to the viewer with that recording."""

    server: _Server

    def do_GET(self) -> None:
        """Send a file of the folder, the page, or a redirection to the viewer."""
        path = unquote(self.path.partition("?")[0])
        if not self._addressed():
            self.send_error(http.HTTPStatus.MISDIRECTED_REQUEST)
        elif path.startswith("/open/"):
            self.send_response(http.HTTPStatus.FOUND)
            self.send_header("Location", _viewed(self.server.viewer, self.server.address, path[6:]))
            self.end_headers()
        elif self._own_file():
            super().do_GET()
        else:
            self.send_error(http.HTTPStatus.NOT_FOUND)

    def _addressed(self) -> bool:
        """Whether the request names this server as its host.

        Otherwise a page of another host, whose name was redirected to 127.0.0.1 after loading
        (DNS rebinding), could read the folder.
        """
        port = self.server.server_address[1]
        return self.headers.get_all("Host") in ([f"{HOST}:{port}"], [f"localhost:{port}"])

    def _own_file(self) -> bool:
        """Whether the path is a regular file inside the folder, not behind a symbolic link."""
        file, folder = Path(self.translate_path(self.path)), Path(self.directory)
        if self.path.partition("?")[0] == "/":  # this is the only URL of the folder
            file = folder / "index.html"
        if file.suffix not in SERVED or not file.is_relative_to(folder):
            return False
        below = [file, *file.parents][: len(file.relative_to(folder).parts)]
        return file.is_file() and not any(part.is_symlink() for part in below)

    def do_HEAD(self) -> None:
        """Refuse HEAD requests."""
        self.send_error(http.HTTPStatus.METHOD_NOT_ALLOWED)

    def list_directory(self, path: str | os.PathLike[str]) -> None:
        """Refuse to list a folder."""
        self.send_error(http.HTTPStatus.NOT_FOUND)

    def end_headers(self) -> None:
        """Allow the viewer, and no other page, to read the files."""
        self.send_header("Access-Control-Allow-Origin", self.server.viewer)
        self.send_header("Content-Security-Policy", POLICY)
        self.send_header("X-Content-Type-Options", "nosniff")
        super().end_headers()

    def log_message(self, format: str, *args: Any) -> None:
        """Do not log requests."""


def _viewed(viewer: str, files: str, name: str) -> str:
    """The viewer's address with a recording, drawn by WebGL, which every browser supports."""
    return f"{viewer}/?url={quote(f'{files}/{quote(name)}', safe='')}&renderer=webgl"


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        port: int = probe.getsockname()[1]
        return port


def _start_viewer(port: int, files: str) -> subprocess.Popen[bytes]:
    """Start rerun's web viewer and wait until it answers. With a file it opens no data port."""
    program = Path(sys.executable).with_name("rerun")
    options = ["--serve-web", "--bind", HOST, "--web-viewer-port", str(port), f"{files}/none.rrd"]
    quiet = {**os.environ, "RERUN_ANALYTICS": "0", "RUST_LOG": "error"}
    # `rerun` is a script that starts the program. In one process group both can be ended.
    viewer = subprocess.Popen(
        [program, *options],
        env=quiet,
        stdin=subprocess.PIPE,  # both hold it
        stdout=subprocess.DEVNULL,
        start_new_session=True,
    )
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end and viewer.poll() is None:
        connection = http.client.HTTPConnection(HOST, port, timeout=1)
        try:
            connection.request("HEAD", "/")
            connection.getresponse()
        except OSError:
            time.sleep(0.1)
        else:
            return viewer
        finally:
            connection.close()
    _end(viewer)
    raise OSError(f"the web viewer did not come up on {HOST}:{port} within {PATIENCE:.0f} s")


def _end(viewer: subprocess.Popen[bytes]) -> None:
    """End the script and the program that it started, and wait until neither holds its input."""
    assert viewer.stdin is not None
    held = select.poll()
    held.register(viewer.stdin, 0)  # reports an error when nobody holds the other end
    with contextlib.suppress(ProcessLookupError):
        os.killpg(viewer.pid, signal.SIGTERM)
        viewer.wait()
        if not held.poll(1000 * PATIENCE):
            os.killpg(viewer.pid, signal.SIGKILL)
    viewer.wait()
    viewer.stdin.close()
