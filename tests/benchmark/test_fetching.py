"""Downloads from a server on this machine: interrupted, with wrong bytes, with a full disk."""

import hashlib
import http.server
import os
import resource
import signal
import subprocess
import sys
import threading
import time

import pytest

from tauguard.benchmark import fetching, manifest
from tauguard.benchmark.manifest import Converted, DataSet, Original, sets
from tauguard.findings import ArgumentError, FileError

CONTENT = {f"logs/{k}.csv": bytes([k]) * 5000 for k in range(4)}


class Server(http.server.ThreadingHTTPServer):
    """Serves ``files`` by path; ``asked`` lists the requests, ``wait`` delays each [s]."""

    daemon_threads = True

    def __init__(self, files):
        super().__init__(("127.0.0.1", 0), Handler)
        self.files, self.asked, self.cut, self.wait = dict(files), [], set(), 0.0
        self.url = f"http://127.0.0.1:{self.server_address[1]}"


class Handler(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        self.server.asked.append(self.path)
        time.sleep(self.server.wait)
        content = self.server.files.get(self.path.lstrip("/"))
        if content is None:
            self.send_error(404)
            return
        self.send_response(200)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        cut = self.path in self.server.cut
        self.server.cut.discard(self.path)
        self.wfile.write(content[: len(content) // 2] if cut else content)

    def log_message(self, *args):
        pass


@pytest.fixture
def serve():
    running = []

    def start(files):
        server = Server(files)
        threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        running.append(server)
        return server

    yield start
    for server in running:
        server.shutdown()
        server.server_close()


@pytest.fixture
def server(serve, monkeypatch):
    """A set of four small files, published without a licence."""
    sha = {path: hashlib.sha256(content).hexdigest() for path, content in CONTENT.items()}
    originals = tuple(Original(path, 5000, sha[path]) for path in CONTENT)
    logs = tuple(Converted(f"arm/{p[5:]}", (p,), 5000, sha[p]) for p in CONTENT)
    one = DataSet("arm", "an arm", "none stated", "A. Author 2020", "http://127.0.0.1/page",
                  "http://127.0.0.1:9/", "", "same", originals, logs)  # fmt: skip
    monkeypatch.setattr(manifest, "sets", lambda: {"arm": one})
    monkeypatch.setattr(fetching, "PAUSE", 0.01)
    return serve({f"arm/{path}": content for path, content in CONTENT.items()})


def stored(folder):
    return {p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()}


COMPLETE = {f"arm/{k}.csv" for k in range(4)} | {f"originals/arm/logs/{k}.csv" for k in range(4)}
COMPLETE |= {"licences/arm.txt"}


def test_a_set_is_downloaded_once_and_its_licence_stays_beside_it(server, tmp_path):
    lines = []
    fetching.fetch("arm", server.url, tmp_path, lines.append)
    assert stored(tmp_path) == COMPLETE
    assert all((tmp_path / "arm" / p[5:]).read_bytes() == c for p, c in CONTENT.items())
    notice = (tmp_path / "licences" / "arm.txt").read_text()
    assert "none stated" in notice
    assert "pass on none" in notice
    assert "A. Author 2020" in "\n".join(lines)
    fetching.fetch("arm", server.url, tmp_path, lines.append)
    assert len(server.asked) == 4
    assert "complete" in lines[-1]


def test_only_what_is_missing_or_damaged_is_downloaded_again(server, tmp_path):
    fetching.fetch("arm", server.url, tmp_path, list().append)
    (tmp_path / "arm" / "1.csv").unlink()
    (tmp_path / "originals/arm/logs/1.csv").write_bytes(b"\x01" * 4999 + b"\x02")
    fetching.fetch("arm", server.url, tmp_path, list().append)
    assert server.asked[4:] == ["/arm/logs/1.csv"]
    assert (tmp_path / "arm" / "1.csv").read_bytes() == CONTENT["logs/1.csv"]


def test_a_broken_transfer_is_repeated(server, tmp_path):
    server.cut = {"/arm/logs/0.csv", "/arm/logs/3.csv"}
    fetching.fetch("arm", server.url, tmp_path, list().append)
    assert stored(tmp_path) == COMPLETE
    assert server.asked.count("/arm/logs/3.csv") == 2


def test_a_wrong_byte_is_refused(server, tmp_path):
    right = server.files["arm/logs/2.csv"]
    server.files["arm/logs/2.csv"] = right[:-1] + b"\xff"
    with pytest.raises(FileError, match=r"logs/2.csv: 5000 bytes with the hash .* again"):
        fetching.fetch("arm", server.url, tmp_path, list().append)
    assert not (tmp_path / "originals/arm/logs/2.csv").exists()
    server.files["arm/logs/2.csv"] = right
    fetching.fetch("arm", server.url, tmp_path, list().append)
    assert stored(tmp_path) == COMPLETE


def test_a_full_disk_leaves_complete_files_and_says_what_to_do(server, tmp_path):
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4000, hard))  # writes fail as on a full disk
    try:
        with pytest.raises(FileError, match="make room"):
            fetching.fetch("arm", server.url, tmp_path, list().append)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert stored(tmp_path) == {"licences/arm.txt"}
    fetching.fetch("arm", server.url, tmp_path, list().append)
    assert stored(tmp_path) == COMPLETE


def test_errors_say_what_to_do(server, tmp_path):
    del server.files["arm/logs/0.csv"]
    with pytest.raises(FileError, match="404"):
        fetching.fetch("arm", server.url, tmp_path, list().append)
    assert len(server.asked) == 1  # a missing file is not asked for again
    with pytest.raises(FileError, match="no connection"):
        fetching.fetch("arm", "http://127.0.0.1:9", tmp_path, list().append)
    with pytest.raises(ArgumentError, match="did you mean arm"):
        fetching.fetch("arms", server.url, tmp_path)
    with pytest.raises(ArgumentError, match="expected an address"):
        fetching.fetch("arm", "/some/folder", tmp_path)


def test_a_git_blob_has_the_hash_that_git_gives_it():
    # `printf hello | git hash-object --stdin`
    assert manifest.hashed(b"hello", manifest.GIT) == (
        manifest.GIT + "b6fc4c620b67d95f953a5c1c1230aaab5db5a1b0"
    )


def test_the_manifest_names_each_file_once():
    every = sets()
    assert {"ur10e", "ur5", "panda_touch", "panda_touch_blind"} <= every.keys()
    for one in every.values():
        paths = {original.path for original in one.originals}
        assert len(paths) == len(one.originals)
        assert {path for log in one.converted for path in log.originals} <= paths
        assert one.licence
        assert one.page.startswith("https://")
    logs = [log.path for one in every.values() for log in one.converted]
    assert len(set(logs)) == len(logs)
    with pytest.raises(ArgumentError, match="get it at"):
        manifest.chosen("voraus_ad")
    assert [one.name for one in manifest.chosen("ur5")] == ["ur_urdf", "ur5"]


@pytest.mark.data
def test_a_run_that_is_killed_five_times_ends_complete(serve, tmp_path, data_dir):
    """The logs of the UR10e, which are published as they are used."""
    one = sets()["ur10e"]
    files = {f"ur10e/{log.originals[0]}": (data_dir / log.path).read_bytes()
             for log in one.converted}  # fmt: skip
    server = serve(files)
    server.wait = 0.02
    command = [sys.executable, "-c", FETCH, server.url, str(tmp_path)]
    for kill in range(5):
        before = len(server.asked)
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        while len(server.asked) < before + 1 + kill % 3 and process.poll() is None:
            time.sleep(0.002)
        process.send_signal(signal.SIGKILL)
        assert process.wait() == -signal.SIGKILL
    done = subprocess.run(command, capture_output=True, text=True, env=os.environ, check=False)
    assert done.returncode == 0, done.stderr
    assert not list(tmp_path.rglob("*.part"))
    for log in one.converted:
        assert hashlib.sha256((tmp_path / log.path).read_bytes()).hexdigest() == log.sha256
    assert len(server.asked) <= len(one.originals) + 5  # at most one file a kill was lost


FETCH = """
import sys
from pathlib import Path
from tauguard.benchmark.fetching import fetch
fetch("ur10e", sys.argv[1], Path(sys.argv[2]))
"""
