"""Collisions in logs: a push that is added to the currents is found, what is not there is not."""

import json
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

from tauguard import Log, LogDetection
from tauguard.cli import main
from tauguard.detectors import ArmModel, FrictionModel, RobotNumbers
from tauguard.detectors.calibration import joints
from tauguard.detectors.events import Alarm
from tauguard.findings import Findings
from tauguard.models import pin_model
from tauguard.traces import Trace

ARM = """
<mujoco><worldbody>
  <body name="a" pos="0 0 .3"><joint name="j1" axis="0 0 1"/>
    <geom type="capsule" size=".05" fromto="0 0 0 .4 0 0" mass="4"/>
    <body name="b" pos=".4 0 0"><joint name="j2" axis="0 1 0"/>
      <geom type="capsule" size=".04" fromto="0 0 0 .3 0 0" mass="2"/></body></body>
</worldbody></mujoco>
"""
COLUMNS = {"t": 0, "q": [1, 2], "qd": [3, 4], "current": [5, 6]}
GAINS = np.array([8.0, 5.0])


@pytest.fixture
def log(tmp_path):
    """20 s at 250 Hz whose torques are Pinocchio's, with a push of 8 N m on joint 2 at 14 s."""
    rng = np.random.default_rng(0)
    (tmp_path / "arm.xml").write_text(ARM)
    (tmp_path / "columns.json").write_text(json.dumps(COLUMNS))
    model = pin_model(tmp_path / "arm.xml")
    data = model.createData()
    t = np.arange(5000) / 250
    w, phase = np.array([0.7, 1.1]), np.array([0.0, 0.5])
    q = 0.8 * np.sin(w * t[:, None] + phase)
    qd = 0.8 * w * np.cos(w * t[:, None] + phase)
    qdd = -w * w * q
    tau = np.array([pin.rnea(model, data, *row) for row in zip(q, qd, qdd, strict=True)])
    tau[(t >= 14) & (t < 14.4), 1] -= 8.0
    current = tau / GAINS + 0.01 * rng.standard_normal(tau.shape)
    table = np.column_stack([t, q, qd, current])
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", fmt="%.9g")
    return tmp_path


def run(folder, *flags):
    main(
        [
            "detect",
            str(folder / "log.csv"),
            "--robot",
            str(folder / "arm.xml"),
            "--columns",
            str(folder / "columns.json"),
            *(() if {"--quiet", "--model"} & {*flags} else ("--quiet", "12")),
            *flags,
        ]
    )


def test_columns_are_found_by_the_names_of_the_robots_joints(log, capsys):
    (log / "arm.xml").write_text(ARM.replace('"j1"', '"base"').replace('"j2"', '"elbow"'))
    table = np.loadtxt(log / "log.csv", delimiter=",")[:, [0, 2, 1, 4, 3, 6, 5]]
    header = "t,q_elbow,q_base,qd_elbow,qd_base,current_elbow,current_base"
    np.savetxt(log / "log.csv", table, delimiter=",", fmt="%.9g", header=header, comments="")
    run(log, "--columns", "auto", "--gains", "8", "5")
    assert "1 alarm in 8.0 s watched" in capsys.readouterr().out


def test_the_robot_file_is_read_once_and_a_linear_axis_in_degrees_is_refused(
    log, capsys, monkeypatch
):
    table = np.loadtxt(log / "log.csv", delimiter=",")
    table[:, 1:5] *= 180 / np.pi
    header = "t,q_j1,q_j2,qd_j1,qd_j2,current_j1,current_j2"
    np.savetxt(log / "log.csv", table, delimiter=",", fmt="%.9g", header=header, comments="")
    parsed = []
    monkeypatch.setattr(joints, "pin_model", lambda file: parsed.append(file) or pin_model(file))
    run(log, "--columns", "auto", "--gains", "8", "5")
    assert "1 alarm in 8.0 s watched" in capsys.readouterr().out
    assert parsed == [log / "arm.xml"]
    (log / "arm.xml").write_text(ARM.replace('name="j2"', 'name="j2" type="slide"'))
    with pytest.raises(SystemExit):
        run(log, "--columns", "auto", "--gains", "8", "5")
    assert "log.csv: j2 is a linear axis, but is read in degrees" in capsys.readouterr().err


def test_the_push_is_found_and_nothing_else(log, capsys):
    out = log / "found"
    run(log, "--gains", "8", "5", "--out", str(out), "--json", str(log / "figures.json"))
    figures = json.loads((log / "figures.json").read_text())
    assert figures["alarms"] == 1
    event = figures["events"][0]
    assert 14.0 < event["start"] < 14.2
    assert event["joint"] == "j2"
    assert sorted(p.name for p in out.iterdir()) == ["detect.mcap", "detect.rrd", "events.json"]
    assert json.loads((out / "events.json").read_text()) == figures
    text = capsys.readouterr().out
    assert "1 alarm in 8.0 s watched; if nothing touched the arm, each is a false alarm" in text
    assert "free-motion: score above 1" in text
    assert "kinds of contact" not in text  # an unknown load may change: payload
    run(log, "--gains", "8", "5", "--payload", "0", "--json", str(log / "figures.json"))
    (event,) = json.loads((log / "figures.json").read_text())["events"]
    said = capsys.readouterr().out
    assert f"kinds of contact, 0.3 s or more after an alarm begins: {event['kind']}: it " in said


def test_times_of_a_clock_are_printed_from_the_first_sample(log, capsys):
    table = np.loadtxt(log / "log.csv", delimiter=",")
    table[:, 0] += 1.7e9
    np.savetxt(log / "log.csv", table, delimiter=",", fmt="%.17g")
    run(log, "--gains", "8", "5", "--json", str(log / "figures.json"))
    (event,) = json.loads((log / "figures.json").read_text())["events"]
    assert event["start"] > 1.7e9 + 14
    text = capsys.readouterr().out
    assert "times count from the log's first sample, at 1700000000.000 s" in text
    assert f"alarm {event['start'] - 1.7e9:.3f} s to " in text


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        ((), "--gains: give 2 numbers"),
        (("--gains", "8"), "--gains: 1 numbers for 2 joints"),
        (("--gains", "8", "0"), "every number must be finite and not 0"),
        (("--gains", "8", "5", "--quiet", "50"), "and below the log's 20.0 s"),
        (("--gains", "8", "5", "--quiet", "0"), "--quiet 0: expected above 0"),
        (
            ("--gains", "8", "5", "--quiet", "2"),
            "first 2 s (--quiet): 2 s of motion in all",
        ),
        (("--gains", "8", "5", "--columns", "ur10e"), "line 1: 7 columns, expected 31"),
        (("--gains", "8", "5", "--robot", "no.urdf"), "no.urdf: no such robot file"),
        (("--gains", "8000", "5000"), "milliamperes, add --mend mA; else check the gains"),
        (("--gains", "8", "-5"), "the currents of j2 seem to have the opposite sign"),
        (
            ("--model", "m.json", "--quiet", "5", "--gains", "8", "5"),
            "--quiet and --gains cannot be combined",
        ),
    ],
)
def test_bad_input_is_one_line_and_code_2(log, capsys, flags, message):
    with pytest.raises(SystemExit) as stop:
        run(log, *flags)
    assert stop.value.code == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert message in error


def test_joints_that_do_not_match(log, capsys):
    one = ARM.replace('<joint name="j2" axis="0 1 0"/>', "")
    (log / "one.xml").write_text(one)
    with pytest.raises(SystemExit):
        run(log, "--gains", "8", "5", "--robot", str(log / "one.xml"))
    assert "the log has 2 joints (joint_1, joint_2), the robot 1 (j1)" in capsys.readouterr().err


def test_a_short_log_is_said_to_be_short(log, capsys):
    run(log, "--gains", "8", "5")
    assert "0.1 min are too short to say how many an hour" in capsys.readouterr().out


@pytest.mark.data
def test_a_real_collision_free_file_raises_few_alarms(data_dir, tmp_path, capsys):
    folder = data_dir / "ur10e"
    main(
        [
            "detect",
            str(folder / "free" / "ur-20_02_12-40sec_12harm.csv"),
            "--robot",
            str(folder / "ur10e.urdf"),
            "--columns",
            "ur10e",
            "--quiet",
            "20",
            "--out",
            str(tmp_path / "out"),
            "--json",
            str(tmp_path / "figures.json"),
        ]
    )
    figures = json.loads((tmp_path / "figures.json").read_text())
    assert figures["alarms"] <= 1
    assert 29 < figures["watched_seconds"] < 30
    assert (tmp_path / "out" / "detect.rrd").exists()


URDF = """<robot name="arm"><link name="base"/>
  <link name="a"><inertial><origin xyz=".2 0 0"/><mass value="4"/>
    <inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>
    {shape}</link>
  <link name="b"><inertial><origin xyz=".2 0 0"/><mass value="2"/>
    <inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz=".2 0 0"/><geometry><box size=".4 .1 .1"/></geometry></collision></link>
  <joint name="j1" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="50" velocity="2"/></joint>
  <joint name="j2" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
    <origin xyz=".4 0 0"/><limit lower="-3" upper="3" effort="50" velocity="2"/></joint>
</robot>"""
BOX = '<collision><origin xyz=".2 0 0"/><geometry><box size=".4 .1 .1"/></geometry></collision>'


@pytest.mark.parametrize(("shape", "said"), [(BOX, ()), ("", ("no shape found of a",))])
def test_a_urdf_gives_link_and_force_of_each_alarm(tmp_path, shape, said):
    robot = tmp_path / "arm.urdf"
    robot.write_text(URDF.format(shape=shape))
    rng = np.random.default_rng(0)
    t = np.arange(1000) / 250
    tau = 0.05 * rng.standard_normal((1000, 2))  # gravity asks for nothing about vertical axes
    pushed = (t >= 2) & (t < 2.4)
    tau[pushed] -= np.array([0.7 * 30, 0.3 * 30])  # 30 N along y, 0.3 m out on link b
    trace = Trace(("j1", "j2"), t, np.zeros((1000, 2)), np.zeros((1000, 2)), tau)
    arm = ArmModel(
        RobotNumbers.from_pin(pin_model(robot)),
        np.ones(2),
        FrictionModel.coulomb_viscous([0.0, 0.0], [0.0, 0.0]),
        np.array([0.1, 0.1]),
    )
    detector = SimpleNamespace(detector=SimpleNamespace(arm=arm))
    found = SimpleNamespace(
        detection=SimpleNamespace(alarms=[Alarm(2.02, 2.4)]),
        findings=Findings(),
        joint_of=lambda alarm: 1,
    )
    detection = LogDetection(Log(trace), trace, detector, found, robot=robot)
    (one,) = detection.diagnose()
    event = one.to_dict()
    assert event["link"] == one.link == 2
    assert event["force_n"][1] == pytest.approx(30, rel=0.35)
    assert event["peak_force_n"]["low"] < 30 < event["peak_force_n"]["high"]
    notes = [finding.text for finding in detection.findings.of("shapes")]
    assert len(notes) == len(said)
    assert all(text in note for text, note in zip(said, notes, strict=True))
    (row,) = detection.rows()
    assert row["link"] == (2 if one.link_identifiable else None)
