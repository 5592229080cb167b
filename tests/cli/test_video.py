"""A recording becomes a moving picture; what is missing is named in one line."""

import json
import os
import subprocess
import sys
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from PIL import Image

from tauguard.cli import main
from tauguard.envs import Episode, simulate
from tauguard.envs.wrappers import RecordMcap
from tauguard.models import SceneObject, Shape
from tauguard.replay.video import write_video
from tauguard.traces import TARGETS, write_mcap

MAIN = "from tauguard.cli import main; main()"
CART = SceneObject(
    "cart",
    (Shape("box", (0.2, 0.2, 0.2), rgba=(1, 0, 1, 1)),),
    path=((0, -0.5, 0.6, 0.3), (1, 0.5, 0.6, 0.3)),
)


def run(*arguments, **chosen):
    """Without a display, and without MUJOCO_GL unless it is chosen."""
    windows = ("MUJOCO_GL", "PYOPENGL_PLATFORM", "DISPLAY", "WAYLAND_DISPLAY")
    plain = {name: value for name, value in os.environ.items() if name not in windows}
    return subprocess.run(
        [sys.executable, "-c", MAIN, "video", *map(str, arguments)],
        env=plain | chosen,
        capture_output=True,
        text=True,
    )


def test_the_arm_and_what_moves_are_drawn_where_they_are(tmp_path, capsys):
    write_mcap(tmp_path / "a.mcap", simulate(Episode(3, seconds=1.0, objects=(CART,))))
    out = run(tmp_path / "a.mcap", "--rate", 5, "--width", 160, "--height", 120)
    if out.returncode == 2 and "no picture" in out.stderr:
        pytest.skip("the EGL library cannot draw here")
    assert out.returncode == 0, out.stderr
    with Image.open(tmp_path / "a.gif") as file:
        frames = []
        for k in range(file.n_frames):
            file.seek(k)
            frames.append(np.asarray(file.convert("RGB")).astype(int))
    assert len(frames) == 5
    assert frames[0].shape == (120, 160, 3)
    middles = []
    for frame in frames:
        magenta = (frame[..., 0] > frame[..., 1] + 60) & (frame[..., 2] > frame[..., 1] + 60)
        assert magenta.sum() > 20
        middles.append(np.argwhere(magenta)[:, 1].mean())
    steps = np.diff(middles)
    assert (np.sign(steps) == np.sign(steps[0])).all()  # the cart crosses the picture
    assert abs(steps).min() > 2
    with pytest.raises(SystemExit, match="2"):
        main(["video", str(tmp_path / "a.mcap")])  # the picture is there
    assert "--out" in capsys.readouterr().err


def test_a_whole_person_is_in_the_picture(tmp_path):
    """Trousers are drawn, down to the feet, which the floor surrounds."""
    env = RecordMcap(gym.make("tauguard:tauguard/Reach-v0", max_episode_steps=5), tmp_path)
    env.reset(seed=0)
    for _ in range(5):
        env.step(np.zeros(6))
    env.close()
    out = run(tmp_path, "--rate", 20, "--out", tmp_path / "a.png")
    if out.returncode == 2 and "no picture" in out.stderr:
        pytest.skip("no OpenGL can draw here")
    assert out.returncode == 0, out.stderr
    with Image.open(tmp_path / "a.png") as file:
        red, _, blue = np.moveaxis(np.asarray(file.convert("RGB")).astype(int), 2, 0)
    dark = (red < 70) & (blue > red)
    assert dark.sum() > 1000
    assert not dark[-5:].any()


def test_target_and_force_are_drawn_where_they_are(tmp_path):
    """A green ball is drawn until the target has moved on; a red arrow while something presses."""
    trace = simulate(Episode(3, seconds=0.5))
    rows = [[0.0, [[0.4, 0.3, 0.5]]], [trace.t[-1] / 2, [[9.0, 9.0, 9.0]]]]
    vectors = np.zeros((len(trace.t), 3))
    points = np.full((len(trace.t), 3), np.nan)
    late = trace.t > 0.2
    vectors[late], points[late] = (0.0, 0.0, 200.0), (0.5, -0.3, 0.6)
    truth = replace(trace.truth, contact_vector=vectors, contact_point=points)
    attachments = {**trace.attachments, TARGETS: json.dumps(rows)}
    write_mcap(tmp_path / "a.mcap", replace(trace, truth=truth, attachments=attachments))
    out = run(tmp_path / "a.mcap", "--rate", 4, "--out", tmp_path / "a.png")
    if out.returncode == 2 and "no picture" in out.stderr:
        pytest.skip("the EGL library cannot draw here")
    assert out.returncode == 0, out.stderr
    seen = []
    with Image.open(tmp_path / "a.png") as file:
        for k in range(file.n_frames):
            file.seek(k)
            red, green, blue = np.moveaxis(np.asarray(file.convert("RGB")).astype(int), 2, 0)
            ball = (green > red + 40) & (green > blue + 25)
            arrow = (red > green + 60) & (red > blue + 60)
            seen.append((bool(ball.sum() > 20), bool(arrow.sum() > 20)))
    assert seen == [(True, False), (False, True)]


def test_an_opengl_that_is_not_there_is_one_line(tmp_path):
    write_mcap(tmp_path / "a.mcap", simulate(Episode(3, seconds=0.5)))
    out = run(tmp_path / "a.mcap", MUJOCO_GL="osmesa")
    if out.returncode == 0:
        pytest.skip("OSMesa is installed here")
    said = [line for line in out.stderr.splitlines() if line.startswith("tauguard video:")]
    assert out.returncode == 2, out.stderr
    assert "MUJOCO_GL=osmesa" in said[0]
    assert "libosmesa6" in said[0]
    assert "Traceback" not in out.stderr


def test_what_cannot_be_drawn_is_named(tmp_path, capsys):
    bare = simulate(Episode(3, seconds=0.5))
    bare = type(bare)(bare.joint_names, bare.t, bare.q, bare.qd, bare.current)
    write_mcap(tmp_path / "a.mcap", bare)
    with pytest.raises(SystemExit, match="2"):
        main(["video", str(tmp_path / "a.mcap")])
    assert "holds no scene" in capsys.readouterr().err
    with pytest.raises(ValueError, match=r"ending of \.gif"):
        write_video(tmp_path / "a.avi", iter(()), 20.0)
