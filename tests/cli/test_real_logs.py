"""From logs of an arm to a calibrated file, and detection with it; what is refused and named."""

import contextlib
import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pytest

from tauguard import Calibration
from tauguard.cli import main
from tauguard.cli.payload import loads
from tauguard.datasets import columns
from tauguard.detectors.calibration.arm_file import load_arm
from tauguard.detectors.calibration.initial_arm import DRIVES, initial_arm, preset_gains
from tauguard.detectors.calibration.joints import robot_numbers
from tauguard.detectors.calibration.recording import Load, Recording, cut
from tauguard.detectors.features.motion_regimes import unseen_motion
from tauguard.traces.loads import loads_of
from tests.detectors.synthetic_arm import GAIN, XML, held_joint, record
from tests.oracles.added_contact import Added, add_contact

COLUMNS = {"t": 0, "q": [1, 2, 3], "qd": [4, 5, 6], "current": [7, 8, 9]}
GAINS = [str(g) for g in GAIN]


def written(folder, name, trace, scale=1.0):
    table = np.column_stack([trace.t, trace.q, trace.qd, scale * trace.current])
    np.savetxt(folder / name, table, delimiter=",", fmt="%.9g")
    return str(folder / name)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("arm")
    (folder / "arm.xml").write_text(XML)
    (folder / "columns.json").write_text(json.dumps(COLUMNS))
    for seed in range(3):
        written(folder, f"log{seed}.csv", record(seed))
    return folder


def flags(folder, robot="arm.xml"):
    return ["--robot", str(folder / robot), "--columns", str(folder / "columns.json")]


def fails(capsys, *arguments):
    with pytest.raises(SystemExit) as stop:
        main(list(arguments))
    assert stop.value.code == 2
    return capsys.readouterr().err


def refused_until_accepted(capsys, asked, model):
    """Alarms in a detector's own logs: no file without --accept alarms. Returns the refusal."""
    line = fails(capsys, *asked)
    assert not model.exists()
    main([*asked, "--accept", "alarms"])
    assert "note: accepted as --accept alarms says" in capsys.readouterr().out
    assert model.exists()
    return line


@pytest.fixture(scope="module")
def calibrated(folder):
    logs = [str(folder / f"log{seed}.csv") for seed in range(3)]
    out = folder / "calibrated.xml"
    main(["calibrate", *logs, *flags(folder), "--gains", *GAINS, "--out", str(out)])
    return out


def test_detect_without_a_model_is_free_motion_trained_on_the_logs_beginning(
    folder, calibrated, capsys
):
    trace = record(9)
    rows = int(0.7 * len(trace.t))
    at = trace.t[0] + 0.85 * (trace.t[-1] - trace.t[0])
    trace.current[(trace.t > at) & (trace.t < at + 0.4), 1] -= 25.0 / GAIN[1]
    log = written(folder, "fresh.csv", trace)
    head = written(folder, "head.csv", cut(trace, slice(0, rows)))
    quiet = str(float(trace.t[rows] - trace.t[0]))
    for robot, source in (
        (flags(folder, calibrated.name), "those of the calibration in calibrated.xml"),
        ([*flags(folder), "--gains", *GAINS], "those given"),
    ):
        main(["detect", log, *robot, "--quiet", quiet, "--json", str(folder / "own.json")])
        out = capsys.readouterr().out
        assert source in out
        assert "1 alarm in" in out
        model = str(folder / "head.tauguard")
        main(["train", "--free", head, *robot, "--model", model])
        main(["detect", log, *robot[:4], "--model", model, "--out", str(folder / "found")])
        own = json.loads((folder / "own.json").read_text())
        events = json.loads((folder / "found/events.json").read_text())
        assert own["detector"] == events["detector"] == "free-motion"
        assert own["events"] == events["events"]


def test_held_out_residuals_have_the_joints_names(folder, capsys):
    logs = [str(folder / f"log{seed}.csv") for seed in range(2)]
    target = ["--out", str(folder / "two.xml")]
    told = ["--payload", "log1=unknown"]
    main(["calibrate", *logs, *flags(folder), "--gains", *GAINS, *target, *told])
    out = capsys.readouterr().out
    header = next(line for line in out.splitlines() if line.startswith("held out"))
    assert all(name in header for name in ("a [N m]", "b [N m]", "c [N m]"))
    assert "from the gains that were given" in out


@pytest.mark.parametrize(
    ("scale", "order", "doubt"),
    [
        (1000.0, (0, 1, 2), "if they are milliamperes, add --mend mA"),
        (1.0, (2, 0, 1), "give the columns in the order of the robot file's joints"),
        (-1.0, (0, 1, 2), "the sign of the current"),
    ],
)
def test_strange_currents_are_refused(folder, calibrated, capsys, scale, order, doubt):
    trace = record(7)
    trace.current[:] = trace.current[:, order]
    log = written(folder, "strange.csv", trace, scale)
    assert doubt in fails(capsys, "detect", log, *flags(folder, calibrated.name))


def test_a_model_refuses_strange_currents_too(folder, calibrated, capsys):
    logs = [str(folder / f"log{seed}.csv") for seed in range(3)]
    model = str(folder / "model.tauguard")
    robot = flags(folder, calibrated.name)
    main(["train", "--free", *logs, *robot, "--model", model])
    assert "at the tool:" in capsys.readouterr().out
    log = written(folder, "milli.csv", record(8), 1000.0)
    assert "milliamperes?" in fails(capsys, "detect", log, *robot, "--model", model)
    log = written(folder, "right.csv", record(8))
    main(["detect", log, *robot, "--model", model])
    out = capsys.readouterr().out
    assert "0 alarms" in out
    assert "seem" not in out


@pytest.mark.parametrize(
    ("fields", "order", "sign", "said"),
    [
        (["current"], [1, 0, 2], 1, "note: the currents of a and b seem exchanged"),
        (["q", "qd", "current"], [0, 2, 1], 1, "note: the columns of b and c seem exchanged"),
        (["current"], [0, 1, 2], -1, "note: strange.csv: friction would push c"),
        (["q", "qd", "current"], [0, 1, 2], -1, "note: the columns of c seem to have the opposite"),
    ],
)
def test_detect_names_the_columns_of_a_log_that_do_not_fit_the_model(
    folder, calibrated, capsys, fields, order, sign, said
):
    model, robot = str(folder / "own.tauguard"), flags(folder, calibrated.name)
    logs = [str(folder / f"log{seed}.csv") for seed in range(3)]
    main(["train", "--free", *logs, *robot, "--model", model])
    capsys.readouterr()
    trace = record(8)
    signs = np.array([1, 1, sign])
    changed = {key: getattr(trace, key)[:, order] * signs for key in fields}
    log = written(folder, "strange.csv", dataclasses.replace(trace, **changed))
    with contextlib.suppress(SystemExit):  # of some of these the torques are not explained at all
        main(["detect", log, *robot, "--model", model])
    out = capsys.readouterr().out
    assert said in out
    assert out.count("seem") <= 1
    assert out.count("friction would push") <= 1


def test_what_does_not_belong_to_a_model_is_named(folder, calibrated, tmp_path, capsys):
    model = str(folder / "own.tauguard")
    robot = flags(folder, calibrated.name)
    main(["train", "--free", str(folder / "log0.csv"), *robot, "--model", model])
    log = written(folder, "seen.csv", record(8))
    longer = folder / "longer.xml"
    longer.write_text(XML.replace('body pos=".4 0 0"', 'body pos=".5 0 0"'))
    line = fails(capsys, "detect", log, *flags(folder, longer.name), "--model", model)
    assert "longer.xml is not the arm that" in line
    assert "c is 100 mm from its place there" in line
    line = fails(capsys, "detect", log, *robot, "--model", model, "--payload", "heavy")
    assert "--payload heavy: expected KG or KG,X,Y,Z, 0 for nothing" in line
    line = fails(capsys, "detect", str(tmp_path / "none.csv"), *robot, "--model", model)
    assert line.endswith("none.csv: no such file or directory\n")
    main(["detect", log, *robot, "--model", model, "--payload", "0"])
    assert "alarms mean little" not in capsys.readouterr().out


@pytest.mark.parametrize("command", ["calibrate", "train"])
def test_logs_of_another_arm_are_refused(folder, tmp_path, capsys, command):
    named = {"calibrate": ["calibrate"], "train": ["train", "--free"]}[command]
    gains = ["--gains", *GAINS]
    if command == "train":
        gains += ["--model", str(tmp_path / "m.tauguard")]
    wrong = record(5)
    wrong.current[:, 1] *= -1
    mixed = [str(folder / "log0.csv"), written(folder, "mixed.csv", wrong)]
    line = fails(capsys, *named, *mixed, *flags(folder), *gains)
    assert "mixed.csv: friction would push b: the sign" in line
    light = folder / "light.xml"
    light.write_text(XML.replace('mass="4"', 'mass="1"').replace('mass="2"', 'mass=".5"'))
    logs = [str(folder / f"log{seed}.csv") for seed in range(3)]
    line = fails(capsys, *named, *logs, *flags(folder, "light.xml"), *gains)
    assert "the file of another arm, gains that are wrong" in line


def test_a_joint_that_no_log_moves_is_named(folder, calibrated, capsys):
    logs = [written(folder, f"held{seed}.csv", held_joint(seed)) for seed in range(3)]
    model = str(folder / "held.tauguard")
    robot = flags(folder, calibrated.name)
    main(["train", "--free", *logs, *robot, "--model", model])
    out = capsys.readouterr().out
    assert "note: c: moves in none of the logs" in out
    # Of c nothing is measured: all its numbers are prior knowledge, or none.
    (row,) = (line.split() for line in out.splitlines() if line.startswith("c "))
    assert all(cell == "-" or cell.startswith("(") for cell in row[1:])
    main(["detect", written(folder, "held.csv", held_joint(8)), *robot, "--model", model])
    out = capsys.readouterr().out
    assert "0 alarms" in out
    assert "note: the training logs show less than 3 s of" in out
    assert "moving alone: all joints" in out
    assert "starting: c; slow (below 0.1 rad/s): c;" in out
    target = folder / "held.xml"
    main(["calibrate", *logs, *flags(folder), "--gains", *GAINS, "--out", str(target)])
    out = capsys.readouterr().out
    own = {line[0]: line.split() for line in out.splitlines() if line[:3] in ("b  ", "c  ")}
    assert own["c"][-3:] == ["-", "-", "-"]
    assert "-" not in own["b"]
    (note,) = unseen_motion([held_joint(0), record(0)])
    assert note.text.startswith("the logs show less than 3 s of standing for 2 s: a, b;")


def test_what_a_detector_fails_in_its_own_logs_is_refused_unless_accepted(
    folder, calibrated, tmp_path, capsys
):
    """Three pushes in each log: none stands out, and no other log explains them."""
    logs = []
    for seed in range(3):
        trace = record(seed)
        for start in (5.0, 11.0, 17.0):
            push = Added(start + seed, 0.2, (28.0, 20.0, 10.0), "push")
            trace = add_contact(trace, GAIN, push)
        logs.append(written(tmp_path, f"pushed{seed}.csv", trace))
    model = tmp_path / "model.tauguard"
    asked = ["train", "--free", *logs, *flags(folder, calibrated.name), "--model", str(model)]
    line = refused_until_accepted(capsys, asked, model)
    assert "in bursts, as contacts do" in line
    assert "add --accept alarms" in line
    for rate, refused in (("10", True), ("1000", False)):
        main([*asked, "--accept", "alarms", "--false-alarms-per-hour", rate])
        assert ("an hour where 10 are accepted" in capsys.readouterr().out) == refused


def test_a_joint_that_the_other_logs_do_not_predict_is_refused_unless_accepted(folder, capsys):
    odd = held_joint(12)  # c stands, and something holds 20 N m of its torque
    odd.current[:, 2] += 20.0 / GAIN[2]
    logs = [str(folder / "log0.csv"), written(folder, "odd.csv", odd)]
    out = folder / "odd.xml"
    asked = ["calibrate", *logs, *flags(folder), "--gains", *GAINS, "--out", str(out)]
    line = fails(capsys, *asked)
    assert "predicted by the other logs, c in odd.csv " in line
    assert "add --accept error" in line
    assert not out.exists()
    main([*asked, "--accept", "error"])
    assert out.exists()


def test_logs_of_a_standing_arm_are_left_out_of_calibration(folder, tmp_path, capsys):
    still = record(4, seconds=8.0)
    still.q[:], still.qd[:], still.current[:] = still.q[0], 0.0, still.current[0]
    logs = [str(folder / "log0.csv"), written(folder, "still.csv", still)]
    out, model = str(tmp_path / "own.xml"), str(tmp_path / "own.tauguard")
    main(["calibrate", *logs, *flags(folder), "--gains", *GAINS, "--out", out])
    assert "note: still.csv: no joint moves in it" in capsys.readouterr().out
    columns = ["--columns", str(folder / "columns.json")]
    main(["train", "--free", *logs, "--robot", out, *columns, "--model", model])
    assert "trained on 2 logs" in capsys.readouterr().out


def test_payloads_by_file_name_or_stem():
    logs = ["a.csv", "b.x.csv", "b.x.mcap"]
    found = loads_of(loads(("a=2.6", "b.x.mcap=unknown")), logs)
    assert list(found.values()) == [Load(2.6), Load(), None]
    assert loads_of({"a": (2.6, (0.0, 0.1, 0.2))}, logs)["a.csv"] == Load(2.6, (0.0, 0.1, 0.2))
    for text, said in (
        ("b.x=1", "two are called 'b.x'"),
        ("c=1", "no log 'c'"),
        ("a=1,2", "LOG=KG"),
    ):
        with pytest.raises(ValueError, match=said):
            loads_of(loads((text,)), logs)


def test_a_load_in_grams_is_refused():
    with pytest.raises(ValueError, match="at most 100; loads are given in kg"):
        loads_of(loads(("a=2600",)), ["a.csv"])


def test_an_untold_load_names_its_log(folder, capsys):
    logs = [str(folder / f"log{seed}.csv") for seed in range(3)]
    logs.append(written(folder, "laden.csv", record(20, load=3.0)))
    arguments = ["calibrate", *logs, *flags(folder), "--gains", *GAINS]
    arguments += ["--out", str(folder / "laden.xml")]
    with contextlib.suppress(SystemExit):
        main(arguments)
    said = "".join(capsys.readouterr())
    assert "did laden.csv carry something (then give --payload laden.csv=KG or --payload " in said
    main([*arguments, "--payload", "laden=unknown"])
    assert "carry something" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--traces", "x", "--torque"), "--torque: with --free only"),
        (("--traces", "x", "--robot", "r", "--gains", "1"), "--robot, --gains: with --free only"),
        (("--traces", "x", "--mend", "deg"), "--mend or --resample: with --free only"),
        (("--traces", "x", "--calibration", "x"), "--calibration x: the same folder as --traces"),
        (("--free", "x", "--robot", "r", "--confidence", "0.9"), "--confidence: go with --traces"),
        (("--free", "x", "--robot", "r", "--folds", "2"), "--folds: go with --traces only"),
        (("--free", "x", "--twin", "t", "--card", "c.png"), "--twin goes with --free, --columns"),
        (("--traces", "x", "--twin", "t"), "--twin goes with --free, --columns"),
        (("--traces", "x", "--confidence", ".9"), "--confidence belongs to a guarantee"),
        (("--folds", "2"), "give --traces (labelled recordings) or --free"),
    ],
)
def test_flags_of_the_other_training(capsys, arguments, message):
    assert message in fails(capsys, "train", *arguments)


@pytest.mark.parametrize(
    ("fields", "message"),
    [({"t": 0}, "q missing; its fields are t,"), ({"x": 0}, "unknown x; its")],
)
def test_maps_that_are_no_maps(tmp_path, fields, message):
    path = tmp_path / "map.json"
    path.write_text(json.dumps(fields))
    with pytest.raises(ValueError, match=message):
        columns.column_map(str(path))
    with pytest.raises(ValueError, match="no such file; presets are ur10e"):
        columns.column_map(str(tmp_path / "nosuch.json"))


def test_a_log_s_own_preset_is_taken_and_different_ones_are_refused():
    plain = record(0, 1.0)
    own = [dataclasses.replace(plain, meta={"columns": name}) for name in ("ur5", "ur10e")]
    assert preset_gains(own[:1]) == DRIVES["ur5"]
    assert preset_gains([plain, plain]) == ()
    with pytest.raises(ValueError, match="logs of ur10e, ur5, whose drive gains differ"):
        preset_gains(own)
    with pytest.raises(ValueError, match="logs of no preset, ur5, whose drive gains differ"):
        preset_gains([own[0], plain])


def test_where_the_scale_comes_from_is_said(folder):
    numbers = robot_numbers(folder / "arm.xml")
    recordings = [Recording(record(0, 12.0))]
    assert initial_arm(numbers, recordings, tuple(GAIN), "auto")[1] == "gains"
    assert initial_arm(numbers, recordings, (), "auto")[1] == "masses"
    (one,) = recordings
    ur10e = [Recording(dataclasses.replace(one.trace, meta={"columns": "ur10e"}))]
    with pytest.raises(ValueError, match="6 numbers for 3 joints"):
        initial_arm(numbers, ur10e, (), "auto")
    assert load_arm(folder / "arm.xml") is None


def test_a_linear_axis_has_its_own_units_in_the_table():
    robot = SimpleNamespace(
        joint_names=("turn", "rail"),
        prismatic=[False, True],
        inertial=np.ones((2, 10)),
        armature=np.ones(2),
    )
    arm, ones = SimpleNamespace(robot=robot, drive_gain=np.ones(2)), np.ones(2)
    held = {"a.csv": np.array([1.0, 2.0])}
    loads = {"a.csv": 0.0}
    text = str(Calibration(arm, "gains", ones, held, loads, 0 * ones, ones, ones > 0))
    assert "rail (linear: N, m, kg)" in text
    assert "turn [N m]" in text
    assert "rail [N]" in text


def tabled(folder, name, trace, effort, scale=1.0, velocities=True):
    """A log as CSV with a header, and its column map."""
    joints = range(1, trace.q.shape[1] + 1)
    groups = {"q": trace.q, "qd": trace.qd if velocities else None, effort: trace.current * scale}
    groups = {key: value for key, value in groups.items() if value is not None}
    fields = {key: [f"{key}{j}" for j in joints] for key in groups}
    header = ",".join(["t", *(name for group in fields.values() for name in group)])
    table = np.column_stack([trace.t, *groups.values()])
    np.savetxt(folder / name, table, delimiter=",", header=header, comments="", fmt="%.9g")
    (folder / f"{effort}.json").write_text(json.dumps({"t": "t", **fields}))
    return str(folder / name), str(folder / f"{effort}.json")


def test_torques_need_no_gains_and_velocities_may_lack(tmp_path, capsys):
    (tmp_path / "arm.xml").write_text(XML)
    logs = [
        tabled(tmp_path, f"log{k}.csv", record(k), "torque", GAIN, velocities=False)
        for k in range(3)
    ]
    common = ["--robot", str(tmp_path / "arm.xml"), "--columns", logs[0][1]]
    model, card = str(tmp_path / "model.tauguard"), tmp_path / "card.png"
    files = [log for log, _ in logs]
    main(["train", "--free", *files[:2], *common, "--model", model, "--card", str(card)])
    out = capsys.readouterr().out
    assert "no velocities: positions are differentiated" in out
    assert "setCollisionBehavior" not in out  # nor a UR's tool force limit: three joints
    assert "tool force limit" not in out
    assert "replace no safety function" in out
    assert card.stat().st_size > 10_000
    main(["detect", files[2], *common, "--model", model, "--payload", "0"])
    assert "0 alarms in 24" in capsys.readouterr().out
    line = fails(capsys, "train", "--free", *files, *common, "--gains", *GAINS)
    assert "--gains: the logs hold joint torques" in line
    amperes, columns = tabled(tmp_path, "amperes.csv", record(5), "current")
    line = fails(
        capsys, "detect", amperes, "--robot", common[1], "--columns", columns, "--model", model
    )
    assert "of the torque is not explained" in line


def test_joints_that_the_log_lacks_are_held(tmp_path, capsys):
    finger = """<body pos=".3 0 .05"><joint name="finger" type="slide" axis="0 1 0"/>
<geom type="box" size=".01 .01 .03" mass=".05"/></body>"""
    whole = XML.replace("</body></body></body>", finger + "</body></body></body>")
    (tmp_path / "arm.xml").write_text(whole)
    logs = [tabled(tmp_path, f"log{k}.csv", record(k), "torque", GAIN) for k in range(2)]
    out = tmp_path / "arm.calibrated.xml"
    common = ["--columns", logs[0][1], "--robot"]
    files = [log for log, _ in logs]
    main(["calibrate", *files, *common, str(tmp_path / "arm.xml"), "--out", str(out)])
    assert "the log lacks finger of arm.xml: held fixed at 0" in capsys.readouterr().out
    model = str(tmp_path / "model.tauguard")
    main(["train", "--free", *files, *common, str(out), "--model", model])
    main(["detect", files[0], *common, str(out), "--model", model])
    assert "0 alarms" in capsys.readouterr().out


def test_a_load_that_the_torques_do_not_show_is_refused(folder, tmp_path, capsys):
    logs = [str(folder / f"log{seed}.csv") for seed in range(3)]
    given = [*flags(folder), "--gains", *GAINS, "--out", str(tmp_path / "false.xml")]
    error = fails(capsys, "calibrate", *logs, *given, "--payload", "log1=3")
    assert "log1.csv: 3 kg were given, its torques show" in error
    assert not (tmp_path / "false.xml").exists()


def test_a_log_of_pushes_among_free_ones_is_named_and_left_out(folder, calibrated, capsys):
    trace = record(6)
    for start in (3.0, 5.5, 12.0, 15.0, 18.0, 21.0):
        trace = add_contact(trace, GAIN, Added(start, 0.4, (14.0, -18.0, 9.0), "push"))
    logs = [str(folder / f"log{seed}.csv") for seed in range(3)]
    arguments = ["train", "--free", *logs, written(folder, "touched.csv", trace)]
    arguments += [*flags(folder, calibrated.name), "--model", str(folder / "touched.tauguard")]
    main(arguments)
    out = " ".join(capsys.readouterr().out.split())
    assert "touched.csv stands out: 6 alarms at 3." in out
    assert "something touched the arm" in out
    assert "trained on 3 logs" in out
    assert "not learned from, since its alarms stand out: touched.csv" in out
    main([*arguments, "--accept", "touched"])
    out = capsys.readouterr().out
    assert "kept as --accept says" in out
    assert "trained on 4 logs" in out
    assert "--accept other: no log 'other'" in fails(capsys, *arguments, "--accept", "other")


def test_a_standing_arm_alone_is_watched_while_it_stands(folder, tmp_path, capsys):
    trace = record(5, dwell=(-1.0, 99.0))
    log, model = written(tmp_path, "still.csv", trace), str(tmp_path / "m.tauguard")
    main(["train", "--free", log, *flags(folder), "--gains", *GAINS, "--model", model])
    out = capsys.readouterr().out
    assert "a, b, c: moves in none of the logs" in out
    assert "none (none)      moving" in out
    pushed = add_contact(trace, GAIN, Added(12.0, 2.0, (4.0, 4.0, 2.0), "push"))
    main(["detect", written(tmp_path, "pushed.csv", pushed), *flags(folder), "--model", model])
    said = capsys.readouterr().out
    assert "1 alarm in" in said
    assert "no collision is detected" not in said
    main(["detect", written(tmp_path, "moves.csv", record(6)), *flags(folder), "--model", model])
    assert "moves here, but in none of the training logs: no collision is detected" in (
        capsys.readouterr().out
    )


def test_a_standing_log_that_is_touched_all_along_is_refused(folder, tmp_path, capsys):
    """There is no other log to stand out from, and the touches fill more than half of it."""
    trace = record(5, dwell=(-1.0, 99.0))
    for start in np.arange(2.0, 24.0, 0.8):
        trace = add_contact(trace, GAIN, Added(start, 0.5, (2.0, -2.0, 1.0), "push"))
    log, model = written(tmp_path, "touched.csv", trace), tmp_path / "m.tauguard"
    train = ["train", "--free", log, *flags(folder), "--gains", *GAINS, "--model", str(model)]
    line = refused_until_accepted(capsys, train, model)
    assert "touched.csv: 28 alarms at 2." in line
    assert "something touched the arm" in line


def test_time_is_unwatched_while_a_joint_of_unknown_motion_stands_elsewhere(
    folder, tmp_path, capsys
):
    logs = [written(tmp_path, f"held{k}.csv", held_joint(k)) for k in range(3)]
    model, json_file = str(tmp_path / "m.tauguard"), tmp_path / "found.json"
    main(["train", "--free", *logs, *flags(folder), "--gains", *GAINS, "--model", model])
    trace = held_joint(7)
    moved = dataclasses.replace(trace, q=trace.q + np.array([0.0, 0.0, 0.6]))
    detect = [*flags(folder), "--model", model, "--payload", "0", "--json", str(json_file)]
    watched = []
    for name, one in (("as_trained.csv", trace), ("elsewhere.csv", moved)):
        capsys.readouterr()
        main(["detect", written(tmp_path, name, one), *detect])
        said = capsys.readouterr().out
        assert "moves here" not in said
        assert ("c: stands elsewhere than in the training logs" in said) == (one is moved)
        watched.append(json.loads(json_file.read_text())["watched_seconds"])
    assert watched[0] > 24
    assert 1 < watched[1] < 4  # the dwell of 2 s, in which all joints stand
