"""``tauguard twin`` from logs to a file that simulation and detection take."""

import contextlib
import json
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest

from tauguard.cli import main
from tauguard.datasets import TwinEpisodes, twin_contacts
from tauguard.datasets.recordings import labelled
from tauguard.detectors import load_model
from tauguard.detectors.calibration.recording import Load, cut
from tauguard.models import load_arm
from tests.detectors.synthetic_arm import GAIN, XML, held_joint, record
from tests.oracles.added_contact import Added, add_contact

COLUMNS = {
    "t": "t",
    "q": ["q0", "q1", "q2"],
    "qd": ["v0", "v1", "v2"],
    "current": ["i0", "i1", "i2"],
}
HEAD = ",".join(["t", *COLUMNS["q"], *COLUMNS["qd"], *COLUMNS["current"]])
DATASET = """
name = "of-a-twin"
seed = 1
rate = 100
episodes_per_shard = 2
[episodes]
seconds = 7.0
arms = ["a.toml"]
speeds = [30]
struck = 0.5
[[splits]]
name = "train"
individuals = [0]
episodes = 2
"""


def write(path, trace):
    table = np.column_stack([trace.t, trace.q, trace.qd, trace.current])
    np.savetxt(path, table, delimiter=",", fmt="%.9g", header=HEAD, comments="")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("twin")
    (folder / "arm.xml").write_text(XML)
    (folder / "columns.json").write_text(json.dumps(COLUMNS))
    (folder / "free").mkdir()
    for seed in range(3):
        write(folder / "free" / f"log{seed}.csv", record(seed))
    return folder


def run(folder, command, *flags):
    gains = ["--gains", *map(str, GAIN)]
    common = ["--columns", str(folder / "columns.json")]
    main([command, *map(str, flags), *common, *(gains if command == "twin" else [])])


@pytest.fixture(scope="module")
def made(folder):
    """The twin; beside it what the command printed, its figures and its page."""
    out, files = folder / "a.toml", ("--json", folder / "a.json", "--figure", folder / "a.png")
    with open(folder / "a.txt", "w") as said, contextlib.redirect_stdout(said):
        run(folder, "twin", folder / "free", "--robot", folder / "arm.xml", "--out", out, *files)
    return out


def test_every_command_and_environment_takes_the_twin(made, tmp_path):
    friction = load_arm(str(made)).facts.drive.friction
    assert (friction.coulomb + friction.slope.sum(axis=1) > 1).all()
    flags = "--episodes 1 --collisions 1 --workers 1 --payloads-g 0 --mismatch-seed None"
    main(["simulate", "--robot", str(made), "--out", str(tmp_path / "struck"), *flags.split()])
    (trace,) = labelled(tmp_path / "struck")
    assert trace.dt == pytest.approx(0.01, rel=1e-3)  # the logs' rate
    (made.parent / "set.toml").write_text(DATASET)
    where = str(tmp_path / "set")
    main(["generate", str(made.parent / "set.toml"), "--out", where, "--workers", "1"])
    main(["inspect", where, "--verify"])
    one = gym.make("tauguard:tauguard/Reach-v0", robot=str(made), detector="observer")
    many = gym.make_vec("tauguard:tauguard/Reach-v0", num_envs=2, robot=str(made))
    for env in (one, many):
        env.reset(seed=0)
        for _ in range(20):
            seen, *_ = env.step(0.5 * np.ones(env.action_space.shape, np.float32))
        assert np.isfinite(seen).all()
        env.close()


def test_from_logs_to_detection(folder, made, capsys):
    said = (folder / "a.txt").read_text()
    assert "judged on log2.csv" in said
    # The arm is quiet in its own log; so is its twin along it.
    assert "in 25 s: 0 on the arm, 0 on the twin along the same motion" in said
    found = json.loads((folder / "a.json").read_text())
    assert found["judged_on"] == ["log2.csv"]
    assert found["rows"][-1]["residual"] == "area under the curve"
    assert (folder / "a.png").stat().st_size > 1000
    main(["robot", str(made)])
    said = capsys.readouterr().out
    assert "identified from log0.csv, log1.csv, log2.csv" in said
    run(folder, "detect", folder / "free" / "log0.csv", "--robot", made)
    assert "the calibration in a.bodies.xml" in capsys.readouterr().out
    assert "\n# b: mx " in made.read_text()  # with its interval


def test_contacts_are_learned_on_the_twin(folder, made, tmp_path, monkeypatch, capsys):
    model = tmp_path / "model.tauguard"
    few = TwinEpisodes(episodes=4, contacts=2)
    monkeypatch.setattr("tauguard.datasets.twin_contacts", lambda path: twin_contacts(path, few))
    run(folder, "train", "--twin", made, "--free", folder / "free", "--model", model)
    said = capsys.readouterr().out
    assert "free-motion and srq-svr, trained on 3 logs and" in said
    assert "threshold is 5 times the highest score of 3 logs, whatever --false-alarms" in said
    assert "it is high because there are few logs: add separate logs" in said
    alarm = load_model(model)
    assert alarm.detector.arm.robot.joint_names == ("a", "b", "c")
    found = alarm.detector
    # A push on joint b that is far beyond free motion, of the log that another seed makes.
    log = record(9)
    push = add_contact(log, GAIN, Added(14.0, 0.4, (0.0, 40.0, 0.0), "push"))
    score = found.scores(push)
    assert (score >= found.free.scores(push)).all()
    assert alarm.detect(push).alarm[1400:1440].any()
    stream = found.stream()
    steps = np.diff(push.t, prepend=push.t[0] - push.dt)
    rows = zip(push.q, push.qd, push.current, steps, strict=True)
    one = [stream.step(*row) for row in rows]
    np.testing.assert_allclose(one, score, atol=1e-6)
    carrying = found.carrying(Load(1.0, (0.3, 0.0, 0.05)))
    assert carrying.learned is found.learned
    assert (carrying.free.arm.robot.inertial != found.free.arm.robot.inertial).any()
    other = tmp_path / "plain.toml"
    other.write_text(f'file = "{folder / "arm.xml"}"')
    with pytest.raises(SystemExit):
        run(folder, "train", "--twin", other, "--free", folder / "free", "--model", model)
    assert "not the file of a twin" in capsys.readouterr().err


def test_clipped_currents_and_gaps_are_named(folder, tmp_path, capsys):
    log = record(4)
    flat = log.current.copy()
    flat[500:600, 2] = 3.0
    write(tmp_path / "clipped.csv", replace(log, current=flat))
    flags = ("--robot", folder / "arm.xml", "--out", tmp_path / "t.toml")
    with pytest.raises(SystemExit):
        run(folder, "twin", tmp_path / "clipped.csv", *flags)
    assert "clipped.csv: the current of" in capsys.readouterr().err
    keep = np.r_[0:1000, 1300:2500]
    gapped = replace(log, t=log.t[keep], q=log.q[keep], qd=log.qd[keep], current=log.current[keep])
    write(tmp_path / "gap.csv", gapped)
    with pytest.raises(SystemExit):
        run(folder, "twin", tmp_path / "gap.csv", folder / "free" / "log0.csv", *flags)
    assert "no sample in the 3.01 s before it" in capsys.readouterr().err


def test_a_load_that_was_not_told_is_named_and_left_out(folder, tmp_path, capsys):
    write(tmp_path / "carried.csv", record(5, load=2.0))
    logs = [*(folder / "free" / f"log{seed}.csv" for seed in range(3)), tmp_path / "carried.csv"]
    flags = ("--robot", folder / "arm.xml", "--out", tmp_path / "t.toml")
    run(folder, "twin", *logs, *flags)
    said = capsys.readouterr().out
    assert "carried.csv is left out" in said
    assert "--payload carried.csv=KG" in said
    text = (tmp_path / "t.toml").read_text()
    assert 'source = "identified from log0.csv, log1.csv, log2.csv"' in text
    # Of two logs without a load none is left out to judge, which takes most of the time.
    run(folder, "twin", *logs[1:], *flags, "--payload", "carried.csv=2,0.3,0,0.05")
    assert "carried.csv is left out" not in capsys.readouterr().out


def test_what_the_logs_do_not_show_is_named(folder, tmp_path, capsys):
    for seed in (1, 2):
        write(tmp_path / f"held{seed}.csv", held_joint(seed))
    logs = tmp_path / "held1.csv", tmp_path / "held2.csv"
    run(folder, "twin", *logs, "--robot", folder / "arm.xml", "--out", tmp_path / "t.toml")
    said = capsys.readouterr().out
    assert "c: hardly moves; its friction is a prior" in said
    assert "not judged: no log is left for the comparison" in said
    assert "# c: hardly moves" in (tmp_path / "t.toml").read_text()


def test_a_log_that_is_touched_all_along_is_refused_unless_accepted(folder, tmp_path, capsys):
    trace = record(7)
    for start in np.arange(2.0, trace.t[-1] - 1, 3.0):
        trace = add_contact(trace, GAIN, Added(float(start), 0.2, (0.0, 4.0, 8.0), "push"))
    write(tmp_path / "touched.csv", trace)
    out = tmp_path / "t.toml"
    flags = (tmp_path / "touched.csv", "--robot", folder / "arm.xml", "--out", out)
    with pytest.raises(SystemExit):
        run(folder, "twin", *flags)
    line = capsys.readouterr().err
    assert "touched.csv: " in line
    assert "in bursts, as contacts do" in line
    assert "add --accept alarms" in line
    assert not out.exists()
    run(folder, "twin", *flags, "--accept", "alarms")
    assert out.exists()


def test_why_the_logs_that_are_left_make_no_twin(folder, tmp_path, capsys):
    """Of three logs the third is judged on; the other two carry a load."""
    logs = [folder / "free" / f"log{seed}.csv" for seed in range(3)]
    loads = ("--payload", "log0=unknown", "log1=unknown")
    run(folder, "twin", *logs, "--robot", folder / "arm.xml", "--out", tmp_path / "t.toml", *loads)
    said = capsys.readouterr().out
    assert "without log2.csv, the other logs make no twin (all logs carry a load:" in said


def test_short_logs_make_a_twin_without_intervals(folder, tmp_path, capsys):
    for seed in (1, 2):
        log = record(seed)
        write(tmp_path / f"log{seed}.csv", cut(log, slice(0, round(len(log.t) * 7 / 25))))
    logs, out = [tmp_path / f"log{seed}.csv" for seed in (1, 2)], tmp_path / "t.toml"
    run(folder, "twin", *logs, "--robot", folder / "arm.xml", "--out", out)
    said = capsys.readouterr().out
    assert "a twin for the intervals is missing: 6.9 s of motion in all, in each log" in said
    (viscous,) = (line for line in out.read_text().splitlines() if line.startswith("viscous"))
    assert viscous.endswith("# N m s/rad")
