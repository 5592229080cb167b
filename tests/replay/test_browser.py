"""Recordings in a browser: what is served, to whom, and what a browser shows."""

import dataclasses
import http.client
import io
import os
import socket
import struct
import subprocess
import threading
import time
from html.parser import HTMLParser
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import SimpleNamespace
from urllib.parse import unquote

import matplotlib.image
import numpy as np
import pytest

from tauguard.detectors import match_detection
from tauguard.replay import browser, write_rrd
from tauguard.replay.browser import BrowserReplay
from tauguard.replay.events import EventFolder, events_of
from tauguard.traces import Alarm


def beside(name):
    """A module that stands beside this file."""
    spec = spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


arm, chromium = beside("arm"), beside("chromium")


@pytest.fixture(scope="module")
def replay(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wrong")
    trace, detection = arm.make()
    write_rrd(folder / "a b.rrd", trace, detection, whole=True)
    (folder / "index.html").write_text('<a href="open/a b.rrd">here</a>')
    (folder / "secret.txt").write_text("not served")
    with BrowserReplay(folder) as running:
        yield running


def answer(replay, path, **headers):
    connection = http.client.HTTPConnection(*replay.address[7:].split(":"), timeout=10)
    connection.request("GET", path, headers=headers)
    response = connection.getresponse()
    return response, response.read()


def test_the_folders_recordings_and_its_page_are_served_and_nothing_else(replay):
    response, page = answer(replay, "/")
    assert response.status == 200
    assert b"open/a b.rrd" in page
    viewer = replay.url("x").partition("/?")[0]
    response, recording = answer(replay, "/a%20b.rrd")
    assert recording[:4] == b"RRF2"
    assert response.headers["Access-Control-Allow-Origin"] == viewer
    assert replay.address.startswith("http://127.0.0.1:")
    for path in ("/secret.txt", "/../secret.txt", "/%2e%2e/x.rrd", "/missing.rrd"):
        assert answer(replay, path)[0].status == 404


def test_only_one_name_of_the_folder_is_its_page(replay):
    """Another one would be redirected to itself with a slash, which a browser may call a host."""
    for path in ("/a/..", "/\\evil.example/..", "/%2f/evil.example/..%2f", "/./", "/?x/.."):
        status = answer(replay, path)[0].status
        assert status == (200 if path[1] == "?" else 404), path


def test_no_link_leads_out_of_the_folder(tmp_path):
    outside, folder = tmp_path / "outside", tmp_path / "served"
    for place in (outside, folder, folder / "own"):
        place.mkdir()
        (place / "a.rrd").write_bytes(b"RRF2")
    (folder / "file.rrd").symlink_to(outside / "a.rrd")
    (folder / "inner.rrd").symlink_to(folder / "a.rrd")
    (folder / "folder").symlink_to(outside)
    (folder / "index.html").symlink_to(outside / "a.rrd")
    (folder / "text.txt").write_text("not served")
    os.mkfifo(folder / "pipe.rrd")
    with BrowserReplay(folder) as running:
        for path in ("/a.rrd", "/own/a.rrd", "/a.rrd?x", "/./own//a.rrd"):
            assert answer(running, path)[1] == b"RRF2", path
        for path in ("/file.rrd", "/inner.rrd", "/folder/a.rrd", "/", "/index.html", "/pipe.rrd"):
            assert answer(running, path)[0].status == 404, path
        for path in ("/text.txt%23.rrd", "/text.txt#.rrd", "/own/", "/own", "/a.rrd/"):
            assert answer(running, path)[0].status == 404, path
    (tmp_path / "link").symlink_to(folder)  # the folder itself may be named by a link
    with BrowserReplay(tmp_path / "link") as running:
        assert answer(running, "/a.rrd")[1] == b"RRF2"
        assert answer(running, "/file.rrd")[0].status == 404


def test_only_its_own_host_names_are_answered(replay):
    port = replay.address.rpartition(":")[2]
    for own in (f"127.0.0.1:{port}", f"localhost:{port}"):
        assert answer(replay, "/a%20b.rrd", Host=own)[0].status == 200
    for other in ("evil.example", f"evil.example:{port}", "127.0.0.1", "127.0.0.1:1", ""):
        for path in ("/a%20b.rrd", "/", "/open/a%20b.rrd"):
            response, body = answer(replay, path, Host=other)
            assert response.status == 421, (other, path)
            assert b"RRF2" not in body
    host = ("127.0.0.1", int(port))
    for lines in ("", f"Host: 127.0.0.1:{port}\r\nHost: evil.example\r\n"):
        with socket.create_connection(host, timeout=10) as client:
            client.sendall(f"GET /a%20b.rrd HTTP/1.0\r\n{lines}\r\n".encode())
            assert b" 421 " in client.recv(100)


def test_pages_load_and_send_nothing_elsewhere(replay):
    response, _ = answer(replay, "/")
    policy = response.headers["Content-Security-Policy"].split("; ")
    assert {"default-src 'self' data:", "script-src 'none'", "form-action 'none'"} <= {*policy}


class Tags(HTMLParser):
    """The tags of a page, their attributes, and its text."""

    def __init__(self, page):
        super().__init__()
        self.found, self.text = [], ""
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))

    def handle_data(self, data):
        self.text += data


EVIL = """<script>alert(1)</script>"'><img src=x onerror=alert(2)> $\\frac{$ &lt; \u202e"""


def test_every_name_on_a_page_is_text(tmp_path):
    trace, said = with_a_false_alarm()
    collisions = tuple(dataclasses.replace(c, kind=EVIL) for c in trace.truth.collisions)
    truth = dataclasses.replace(trace.truth, collisions=collisions)
    trace = dataclasses.replace(trace, truth=truth, meta={"speed": "40"})
    said = dataclasses.replace(said, detector=EVIL)
    folder = EventFolder(tmp_path / EVIL.replace("/", "_"), late=0.01)
    folder.add(EVIL, match_detection(said, trace), (trace, said))
    page = Tags(folder.finish().read_text())
    assert EVIL in page.text
    assert [tag for tag, _ in page.found].count("script") == 1  # our own
    assert all(attrs["src"] != "x" for tag, attrs in page.found if tag == "img")
    assert not any(name.startswith("on") for _, attrs in page.found for name in attrs)


def test_a_browser_that_leaves_early_prints_nothing(tmp_path, capfd):
    (tmp_path / "large.rrd").write_bytes(bytes(50_000_000))
    with BrowserReplay(tmp_path) as running:
        host, port = running.address[7:].split(":")
        before = threading.active_count()
        with socket.create_connection((host, int(port)), timeout=10) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            probe.sendall(f"GET /large.rrd HTTP/1.0\r\nHost: {host}:{port}\r\n\r\n".encode())
            assert probe.recv(100).startswith(b"HTTP/1.0 200")
        end = time.monotonic() + 10
        while threading.active_count() > before and time.monotonic() < end:
            time.sleep(0.05)
        assert answer(running, "/missing.rrd")[0].status == 404
    assert "Traceback" not in capfd.readouterr().err


def test_a_link_leads_to_the_viewer_with_that_recording(replay):
    response, _ = answer(replay, "/open/a%20b.rrd")
    assert response.status == 302
    target = response.headers["Location"]
    assert target == replay.url("a b.rrd")
    assert f"{replay.address}/a%20b.rrd" in unquote(target)
    viewer = http.client.HTTPConnection(*target[7:].partition("/")[0].split(":"), timeout=10)
    viewer.request("GET", "/")
    assert b"rerun" in viewer.getresponse().read().lower()


@pytest.mark.skipif(chromium.PROGRAM is None, reason="no Chromium")
def test_a_browser_shows_the_arm(replay, tmp_path):
    page = chromium.Page(f"{replay.address}/open/a%20b.rrd", tmp_path / "profile")
    blue, colours, end = 0, 0, time.monotonic() + 120
    try:
        while (blue <= 200 or colours <= 300) and time.monotonic() < end:
            time.sleep(0.5)
            picture = matplotlib.image.imread(io.BytesIO(page.picture()))
            scene = picture[60:330, 10:380, :3]  # the 3D view
            # as blue as the arm's cylinder
            blue = ((scene[..., 2] > scene[..., 0] + 0.2) & (scene[..., 2] > 0.3)).sum()
            colours = len(np.unique(scene.reshape(-1, 3), axis=0))
    finally:
        page.close()
    assert blue > 200
    assert colours > 300  # shaded, not blank


def test_nothing_is_left_when_it_is_closed(tmp_path):
    with BrowserReplay(tmp_path) as running:
        viewer = running.url("x")[7:].partition("/")[0].split(":")
    for address in (viewer, running.address[7:].split(":")):
        with socket.socket() as probe:
            assert probe.connect_ex((address[0], int(address[1]))) != 0


def test_closing_waits_for_the_program_that_the_script_started(tmp_path):
    """The script ends at once, the program half a second later."""
    note = tmp_path / "note"
    program = f"trap 'sleep 0.5; echo gone > {note}; exit' TERM; echo up > {note}; "
    script = [
        "sh",
        "-c",
        'exec 3<&0; (eval "$0") <&3 & wait',
        program + "while :; do sleep 0.05; done",
    ]
    viewer = subprocess.Popen(script, stdin=subprocess.PIPE, start_new_session=True)
    while not note.exists() or note.read_text() != "up\n":
        time.sleep(0.01)
    browser._end(viewer)
    assert note.read_text() == "gone\n"


def with_a_false_alarm():
    """A trace whose first of three collisions is missed, two found after 12 ms, and an alarm."""
    trace, detection = arm.make(hits=3)
    false = Alarm(trace.t[50], trace.t[60])
    said = dataclasses.replace(detection, alarms=(false, *detection.alarms))
    return trace, said


def test_every_kind_of_mistake_has_its_recording_its_picture_and_its_row(tmp_path):
    trace, said = with_a_false_alarm()
    folder = EventFolder(tmp_path / "wrong", late=0.01)
    folder.add("test/0", match_detection(said, trace), (trace, said))
    page = folder.finish().read_text()
    names = {p.name for p in (tmp_path / "wrong").glob("*.rrd")}
    assert names == {"missed-001.rrd", "late-001.rrd", "late-002.rrd", "false-alarm-001.rrd"}
    assert all(f'<a href="open/{name}">{name}</a>' in page for name in names)
    assert "1 missed, 2 late, 1 false alarm" in page
    assert "more than 10 ms after the onset" in page
    assert page.count("test/0") == 4
    for name in names:
        picture = Path(name).with_suffix(".png").name
        assert f'src="{picture}"' in page
        drawn = matplotlib.image.imread(tmp_path / "wrong" / picture)
        assert drawn.shape[1] == 800
        assert drawn[..., :3].std() > 0.05


def test_a_row_has_the_score_beside_its_threshold_the_speed_and_the_load(tmp_path):
    trace, said = with_a_false_alarm()
    touch = trace.truth.collisions[0].onset
    payload = np.where(trace.t < touch, 0.0, 0.75)
    truth = dataclasses.replace(trace.truth, payload=payload)
    trace = dataclasses.replace(trace, truth=truth, meta={"speed": "40.0"})
    score = np.where((trace.t > touch + 0.1) & (trace.t < touch + 0.2), 4.56, 1.0)
    said = dataclasses.replace(said, score=score)
    folder = EventFolder(tmp_path / "wrong", late=0.01)
    folder.add("a.mcap", match_detection(said, trace), (trace, said))
    missed, *_, false = folder.rows
    assert (missed["largest score"], false["largest score"]) == (4.56, 1.0)
    assert {row["threshold"] for row in folder.rows} == {5.0}
    assert (missed["payload [g]"], false["payload [g]"]) == (750, 0)
    assert {row["speed [%]"] for row in folder.rows} == {40.0}


def test_what_is_not_known_of_a_recording_has_no_column(tmp_path):
    trace, said = with_a_false_alarm()
    score = np.full(len(trace.t), -np.inf)  # never settled
    said = dataclasses.replace(said, score=score)
    folder = EventFolder(tmp_path / "wrong", late=0.01)
    folder.add("a.mcap", match_detection(said, trace), (trace, said))
    page = folder.finish().read_text()
    assert folder.rows[0]["speed [%]"] == folder.rows[0]["largest score"] == ""
    assert "<th>speed [%]</th>" not in page
    assert "<th>payload [g]</th>" in page


def test_a_score_above_the_threshold_for_too_short_is_no_largest_score(tmp_path):
    """A page that showed the raw score would show an alarm where none can be."""
    trace, said = with_a_false_alarm()
    touch = trace.truth.collisions[0].onset
    score = np.where(np.abs(trace.t - touch - 0.1) < 2e-3, 100.0, 1.0)
    said = dataclasses.replace(said, score=score)
    alarm = SimpleNamespace(confirmation=0.01, settle=1.0)
    folder = EventFolder(tmp_path / "wrong", 0.01, alarm)
    folder.add("a.mcap", match_detection(said, trace), (trace, said))
    assert folder.rows[0]["largest score"] == 1.0
    page = folder.finish().read_text()
    assert "throughout the last 10 ms" in page
    assert "first 1 s" in page


def test_a_collision_whose_alarm_came_before_the_touch_says_so():
    trace, detection = arm.make(hits=3)
    touch = trace.truth.collisions[0].onset
    early = Alarm(touch - 0.2, touch + 0.1)
    said = dataclasses.replace(detection, alarms=(early, *detection.alarms))
    missed, false = (
        e
        for e in events_of(match_detection(said, trace), 1.0)
        if e.kind in ("missed", "false alarm")
    )
    assert missed.text.endswith(f"missed (an alarm was up from {early.start:.2f} s on)")
    assert false.text == (
        f"False alarm at {early.start:.2f} s (still up at the strike of {touch:.2f} s)"
    )


def test_an_alarm_milliseconds_before_the_touch_reads_earlier():
    trace, detection = arm.make(hits=3)
    touch = trace.truth.collisions[0].onset  # 0.667 s
    said = dataclasses.replace(detection, alarms=(Alarm(touch - 1e-3, touch + 0.1),))
    missed = next(events_of(match_detection(said, trace), 1.0))
    assert f"{touch:.2f}" == f"{touch - 1e-3:.2f}"
    assert missed.note == f"an alarm was up from {touch - 1e-3:.3f} s on"


@pytest.mark.parametrize("name", ["thesis.txt", "episode-00000.rrd"])
def test_a_folder_of_other_things_is_not_written_into(tmp_path, name):
    (tmp_path / name).write_text("keep")
    with pytest.raises(ValueError, match="other files"):
        EventFolder(tmp_path, late=0.05)
    assert (tmp_path / name).read_text() == "keep"
