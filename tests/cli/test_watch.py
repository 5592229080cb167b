"""``tauguard watch``: what is shown is what the environment did, and only this machine sees it."""

import os
import socket
import subprocess
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from rerun.chunk import RrdReader

from tauguard.cli import main
from tauguard.cli.watch import parsed
from tauguard.envs.policies import MlpPolicy
from tauguard.replay import live
from tauguard.traces import read_mcap

POLICIES = Path(__file__).parents[2] / "examples" / "policies"


def entities(path):
    """Number of rows by entity, in time and timeless."""
    found = {}
    for chunk in RrdReader(str(path)).stream():
        batch = chunk.to_record_batch()
        name = str(chunk.entity_path)
        found[name] = found.get(name, 0) + batch.num_rows
    return found


@pytest.mark.parametrize(
    ("arguments", "shown"),
    [
        (
            ["Reach-v0", "--set", "detector=observer"],
            ["/scene/link6", "/scene/person_left_hand", "/residual"],
        ),
        (["ClothReach-v1"], ["/scene/cloth_0"]),
        (["React-v1", "--policy", "still", "--reaction", "stop0"], ["/scene/chest"]),
        (["TwoArms-v1", "--policy", "random"], ["/scene/arm2_link6"]),
    ],
)
def test_a_file_holds_a_row_an_action(arguments, shown, tmp_path, capsys):
    path = tmp_path / "watch.rrd"
    main(["watch", *arguments, "--seconds", "0.2", "--save", str(path)])
    found = entities(path)
    for name in [*shown, "/force", "/tau_ext", "/tool", "/scene/targets"]:
        assert found[name] >= 20, (name, sorted(found))
    assert ("/residual" in found) == ("/residual" in shown)  # a chart only where a detector is
    assert "of its limit" in capsys.readouterr().out
    rerun = [sys.executable, "-m", "rerun", "rrd", "verify", str(path)]
    environment = {**os.environ, "RERUN_ANALYTICS": "0"}
    subprocess.run(rerun, check=True, capture_output=True, env=environment)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["Reich-v0"], "Reach-v0"),
        (["Reach-v0", "--set", "control"], "NAME=VALUE"),
        (["Reach-v0", "--set", "control=torque"], "--policy random"),
        (["Reach-v0", "--set", "wings=2"], "expected one of"),
        (["Reach-v0", "--seconds", "0"], "above 0"),
        (["React-v1", "--reaction", "panic"], "stop0"),
        (["React-v1", "--policy", "stil"], "target, random, still"),
        (["React-v1", "--policy", "numpy:nothing"], "MODULE:NAME"),
        (["React-v1", "--policy", "numpy:pi"], "cannot be called"),
        (["React-v1", "--policy", str(POLICIES / "Reach-v0.npz")], "tauguard/Reach-v0"),
        (["Reach-v0", "--policy", str(POLICIES / "Reach-v0.npz"), "--set", "obstacles=()"], "114"),
    ],
)
def test_bad_input_is_one_line(arguments, words, capsys, tmp_path):
    with pytest.raises(SystemExit) as stop:
        main(["watch", *arguments, "--save", str(tmp_path / "x.rrd")])
    assert stop.value.code == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1


def test_a_trained_policy_is_shown_where_it_was_trained(tmp_path, capsys):
    file, folder = POLICIES / "Reach-v0.npz", tmp_path / "episodes"
    arguments = ["Reach-v0", "--policy", str(file), "--seconds", "0.48", "--seed", "7"]
    main(["watch", *arguments, "--save", str(folder)])
    assert f"tauguard video {folder}" in capsys.readouterr().out
    policy = MlpPolicy.load(file)
    env = gymnasium.make(**policy.environment)
    observation, _ = env.reset(seed=7)
    for _ in range(10):
        observation, *_ = env.step(policy(observation))
    shown = read_mcap(folder / "episode_00000.mcap")
    assert np.array_equal(shown.q[-1], env.unwrapped.batch.q[0][-1])


def test_values_are_literals_or_text():
    assert parsed(("control=torque", "payload_g=500", "obstacles=('hand',)", "labels=False")) == {
        "control": "torque",
        "payload_g": 500,
        "obstacles": ("hand",),
        "labels": False,
    }


class Ended:
    """A process that is over."""

    def poll(self):
        return 1


def test_the_viewer_is_bound_to_this_machine(monkeypatch):
    seen = []

    monkeypatch.setattr(live.subprocess, "Popen", lambda command: seen.append(command) or Ended())
    with pytest.raises(OSError, match="`save="):
        live.open_viewer(19876)
    command = [str(part) for part in seen[0]]
    assert command[command.index("--bind") + 1] == "127.0.0.1"
    assert "0.0.0.0" not in command


def test_a_viewer_that_ended_is_said(tmp_path):
    env = gymnasium.make("tauguard/Reach-v0").unwrapped
    env.reset(seed=0)
    view = live.LiveView(env.compiled.scene.model, tmp_path / "a.rrd")
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        server.listen()
        view._port = server.getsockname()[1]
        view._viewer = Ended()
        view.show(env.batch.datas[0], 0.0, np.zeros((1, 3)))  # another one listens there
    view._viewer = Ended()
    with pytest.raises(OSError, match="ended; without a display use `save"):
        view.show(env.batch.datas[0], 0.0, np.zeros((1, 3)))


def test_a_zero_force_takes_the_arrow_away(tmp_path):
    env = gymnasium.make("tauguard/Reach-v0").unwrapped
    env.reset(seed=0)
    view = live.LiveView(env.compiled.scene.model, tmp_path / "a.rrd")
    view.show(env.batch.datas[0], 0.0, np.zeros((1, 3)))
    view.contact(np.zeros(3), np.array([0.0, 0.0, 100.0]))
    view.contact(np.full(3, np.nan), np.zeros(3))
    view.close()
    assert entities(tmp_path / "a.rrd")["/scene/contact"] == 2
