"""Units in the names of columns: read, refused, or not units at all."""

import re

import numpy as np
import pytest

from tauguard import read_log, read_logs
from tauguard.datasets.columns import ColumnMap
from tauguard.datasets.recognition import described, recognised
from tests.datasets.test_recognition import motion, written


def test_units_may_be_the_last_words_of_names():
    kinds = ("pos_deg", "vel_deg_s", "motor_current_mA")
    names = ["timestamp_us", *(f"axis{k}_{kind}" for kind in kinds for k in (1, 2, 3))]
    table = np.random.default_rng(0).uniform(-1, 1, (50, len(names)))
    table[:, 0], table[:, 7:] = 10_000 * np.arange(50), 800 * table[:, 7:]
    found = recognised(names, table)
    assert found.degrees  # by its name: no angle is beyond two turns
    assert (found.t, found.time_scale, found.current_scale) == ("timestamp_us", 1e-6, 1e-3)
    assert found.qd == ("axis1_vel_deg_s", "axis2_vel_deg_s", "axis3_vel_deg_s")


@pytest.mark.parametrize(
    ("names", "values", "units"),
    [
        (
            ("timestamp_ms", "axis#_pos_rad", "axis#_vel_rad_s", "axis#_current_mA"),
            (0.25, 20, 30),
            (1e-3, False, 1e-3),
        ),
        (
            ("time [us]", "J# angle (rad)", "J# speed (rad/s)", "J# current [A]"),
            (40, 20, 300),
            (1e-6, False, 1.0),
        ),
        (
            ("time (\u00b5s)", "q#_pos [\u00b0]", "q#_vel [\u00b0/s]", "q#_current [mA]"),
            (40, 1, 3),
            (1e-6, True, 1e-3),
        ),
        (("t_s", "pos_#", "vel_deg_s_#", "current_#"), (0.6, 1, 3), (1.0, True, 1.0)),
        (("timestamp_ns", "q_#", "qd_#", "current_A_#"), (1000, 20, 300), (1e-9, True, 1.0)),
        (("seconds", "q[#]", "qd[#]", "current[#]"), (0.6, 1, 300), (1.0, False, 1e-3)),
    ],
)
def test_a_named_unit_beats_what_values_suggest(names, values, units):
    header = [names[0], *(name.replace("#", str(k)) for name in names[1:] for k in (1, 2))]
    table = np.ones((50, 7)) * [0, *(values[k] for k in (1, 1)), 1, 1, values[2], values[2]]
    table[:, 0] = values[0] * np.arange(50)
    found = recognised(header, table)
    assert found.qd == (header[3], header[4])
    assert (found.time_scale, found.degrees, found.current_scale) == units


@pytest.mark.parametrize(
    ("time", "torque", "scales"),
    [
        ("timestamp_msec", "tau_mNm_#", (1e-3, 1e-3)),
        ("time_sec", "joint_#_torque [mNm]", (1.0, 1e-3)),
        ("time_seconds", "torque_# [N\u00b7cm]", (1.0, 1e-2)),
        ("t_usec", "effort_Nm_#", (1e-6, 1.0)),
        ("t [ms]", "measured_torque_# [mN m]", (1e-3, -1e-3)),
    ],
)
def test_every_unit_that_is_taken_off_a_name_is_read(time, torque, scales):
    names = [time, *(kind.replace("#", k) for kind in ("q#", "qd#", torque) for k in "12")]
    table = np.random.default_rng(0).uniform(-1, 1, (50, len(names)))
    table[:, 0] = 0.7 * np.arange(50)
    found = recognised(names, table)
    assert (found.t, found.torque) == (time, tuple(names[5:]))
    assert (found.time_scale, found.torque_scale) == scales
    unit = {1.0: "N m", 1e-2: "N cm", 1e-3: "mN m", -1e-3: "mN m, opposite sign"}[scales[1]]
    assert f"[{unit}]" in described(found)


@pytest.mark.parametrize(
    ("time", "scale", "unit"),
    [
        ("t [min]", 60.0, "min"),
        ("time_minutes", 60.0, "min"),
        ("time (h)", 3600.0, "h"),
        ("Time [hrs]", 3600.0, "h"),
        ("time (UTC)", 1.0, "s"),
    ],
)
def test_a_time_in_minutes_or_hours_is_read(time, scale, unit):
    names = [time, *(f"{kind}{k}" for kind in ("q", "qd", "current") for k in "12")]
    table = np.random.default_rng(0).uniform(-1, 1, (50, 7))
    table[:, 0] = 0.01 / scale * np.arange(50)
    found = recognised(names, table)
    assert (found.t, found.time_scale) == (time, scale)
    assert described(found).startswith(f"time {time.removesuffix(f' [{unit}]')} [{unit}], ")


@pytest.mark.parametrize("unit", ["ticks", "counts", "cycles", "rev", "%", "jd"])
def test_a_time_in_an_unknown_unit_is_refused(unit):
    names = [f"time [{unit}]", *(f"{kind}{k}" for kind in ("q", "qd", "current") for k in "12")]
    table = np.ones((5, 7)) * np.arange(5)[:, None]
    said = f"unit {unit} is not known, expected one of .*ns, .*ms, .*s, .*min, .*h; convert it"
    with pytest.raises(ValueError, match=said):
        recognised(names, table)


def test_the_quadrature_current_is_no_unit():
    names = ["t", *(kind.replace("#", k) for kind in ("q#", "qd#", "current_# (Iq)") for k in "12")]
    found = recognised(names, np.random.default_rng(0).uniform(-1, 1, (50, 7)).cumsum(axis=0))
    assert found.current == ("current_1 (Iq)", "current_2 (Iq)")
    assert found.current_scale == 1.0


@pytest.mark.parametrize("parts", [("sec", "nanosec"), ("stamp_s", "stamp_ns"), ("t", "t_usec")])
@pytest.mark.parametrize("first", [0, 1])
def test_a_time_in_two_columns_is_refused(parts, first):
    names = [
        parts[first],
        parts[1 - first],
        *(f"{kind}{k}" for kind in ("q", "qd", "current") for k in "12"),
    ]
    table = np.random.default_rng(0).uniform(-1, 1, (50, len(names)))
    t = 100 + 0.03125 * np.arange(50)
    table[:, first] = np.floor(t)
    table[:, 1 - first] = 1e9 * (t % 1)
    with pytest.raises(ValueError, match=f"columns {parts[0]} and {parts[1]}: parts of one time"):
        recognised(names, table)
    table[:, first], table[:, 1 - first] = t, 1e9 * t  # a second clock is no part
    assert recognised(names, table).t in parts


@pytest.mark.parametrize("unit", ["rpm", "mrad/s", "turns", "rev_per_s"])
def test_angles_in_other_units_are_refused(unit):
    names = ["t", *(f"{kind}{k}" for kind in ("q", f"velocity_{unit}_", "current") for k in "12")]
    with pytest.raises(ValueError, match=f"column velocity_{unit}_1: expected radians or degrees"):
        recognised(names, np.ones((5, 7)) * np.arange(5)[:, None])


@pytest.mark.parametrize(
    ("name", "said"),
    [
        (
            "torque_# [lbf in]",
            "unit lbf in is not known, expected one of mnm, .*n m; convert",
        ),
        (
            "current_# (counts)",
            "unit counts is not known, expected one of ma, .* a; convert",
        ),
        ("torque_# [ft]", "unit ft is"),
        ("torque_# (in)", "unit in is"),
        ("torque_# [N/m]", "unit N/m is"),
        ("torque_# [m^2]", r"unit m\^2 is"),
        ("torque_# [dNm]", "unit dNm is"),
        ("torque_# [kgf cm]", "unit kgf cm is"),
        ("torque_# [%]", "unit % is"),
        ("torque_# [milli N m]", "unit milli N m is"),
        ("torque_# (N m, filtered)", "unit N m, filtered is"),
        ("torque_# [amperes]", "unit amperes is"),
        ("current_# [rpm]", "unit rpm is"),
    ],
)
def test_a_unit_in_brackets_that_is_not_known_is_refused(name, said):
    names = ["t", *(kind.replace("#", k) for kind in ("q#", "qd#", name) for k in "12")]
    table = np.ones((5, 7)) * np.arange(5)[:, None]
    with pytest.raises(ValueError, match=f"column {name[:7]}.*{said}"):
        recognised(names, table)


@pytest.mark.parametrize(
    ("kinds", "scales"),
    [
        ("t [second],q# (radian),qd# [rad/second],tau# [newton metres]", (1.0, False, 1.0)),
        ("t (s),q# (radians),qd# [rad/sec],tau# [Newton meter]", (1.0, False, 1.0)),
        ("t [milliseconds],q# (degree),qd# [degrees/s],tau# (N·m)", (1e-3, True, 1.0)),
        ("t [seconds],q# [deg],qd# (deg per second),current# [ampere]", (1.0, True, 1.0)),
        ("t [s],q# (shoulder|elbow),qd# (shoulder|elbow),tau# (raw|tool)", (1.0, False, 1.0)),
        ("t [s],q# (J|K),qd#,tau# (shoulder|elbow) [mNm]", (1.0, False, 1e-3)),
        ("t [s],q# (measured),qd# (actual),tau# (estimated)", (1.0, False, 1.0)),
        ("t [s],q# (desired),q# (measured),qd#,current# (q-axis)", (1.0, False, 1.0)),
    ],
)
def test_spelled_units_and_words_that_are_no_unit_are_read(kinds, scales):
    names = []
    for kind in kinds.split(","):
        for k in (0, 1) if "#" in kind else (0,):
            word = re.sub(r"(\w+)\|(\w+)", lambda m, k=k: m.group(k + 1), kind)
            names.append(word.replace("#", str(k + 1)))
    found = recognised(names, np.ones((5, len(names))) * np.arange(5)[:, None])
    assert (found.time_scale, found.degrees, found.torque_scale) == scales
    assert found.current_scale == 1.0
    assert len(found.q) == 2
    assert not any("desired" in name for name in found.q)


def test_units_that_no_map_can_hold_are_refused_by_name(tmp_path):
    t, q, qd, i = motion()
    names = ["t", *(f"axis{k}_{kind}" for kind in ("pos_rad", "vel_deg_s", "amps") for k in (1, 2))]
    path = written(tmp_path / "log.csv", names, t, q, np.rad2deg(qd), i)
    said = "axis1_pos_rad and axis1_vel_deg_s are in different units.*a column map without qd"
    for columns in (None, "auto"):
        with pytest.raises(ValueError, match=said):
            read_log(path, columns)
    columns = ColumnMap("t", tuple(names[1:3]), current=tuple(names[5:]))
    np.testing.assert_allclose(read_log(path, columns).trace.qd[5:], qd[5:], atol=0.05)
    names = ["t", "q1", "q2", "current 1 [A]", "current 2 [mA]"]
    path = written(tmp_path / "mixed.csv", names, t, q, i)
    with pytest.raises(ValueError, match=r"current 2 .* a current_scale for each joint"):
        read_log(path, "auto")


def turned(path, speed, scale=1.0, turns=16.0, motion_of_others=1.0):
    """A log in which joint 3 alone goes beyond two turns, if ``turns`` is above 12.6."""
    t = 0.01 * np.arange(400)
    q = np.column_stack([motion_of_others * np.sin(speed * t + k) for k in range(3)])
    q[:, 2] = turns * t / 4
    qd = np.gradient(q, t, axis=0)
    names = ["t", *(f"{name}{k}" for name in ("q", "qd", "tau") for k in range(3))]
    return written(path, names, t, scale * q, scale * qd, q)


def test_one_joint_beyond_two_turns_does_not_make_degrees(tmp_path):
    """The last joint of some arms turns on; speeds decide, else the user is asked."""
    path = turned(tmp_path / "fast.csv", speed=3.0)
    assert read_log(path, "auto").trace.q[-1, 2] == pytest.approx(16.0, rel=0.01)
    path = turned(tmp_path / "deg.csv", speed=3.0, motion_of_others=10.0, turns=40.0)
    assert "[deg]" in read_log(path, "auto").findings[0].text
    path = turned(tmp_path / "slow.csv", speed=0.5)
    with pytest.raises(ValueError, match=r"q2 is beyond two turns .*`mend=.deg.` or `mend=.rad"):
        read_log(path, "auto")
    assert "[rad]" in read_log(path, "auto", mend=("rad",)).findings[0].text
    assert "[deg]" in read_log(path, "auto", mend=("deg",)).findings[0].text


def three_joints(path):
    inner = '<inertial pos="0 0 .1" mass="1" diaginertia=".01 .01 .01"/>'
    bodies = "".join(f'<body pos="0 0 .3"><joint name="j{k}"/>{inner}' for k in range(3))
    path.write_text(f"<mujoco><worldbody>{bodies}{'</body>' * 3}</worldbody></mujoco>")
    return path


def test_logs_of_one_command_have_one_unit_of_angles(tmp_path):
    arm = three_joints(tmp_path / "arm.xml")
    turned(tmp_path / "slow.csv", speed=0.5)
    usual = turned(tmp_path / "usual.csv", speed=3.0, turns=3.0)
    read = read_logs([tmp_path], "auto", robot=arm)
    assert read["slow.csv"].trace.q[-1, 2] == pytest.approx(16.0, rel=0.01)
    turned(tmp_path / "degrees.csv", speed=1.0, scale=57.3, turns=3.0)
    said = r"usual.csv: its positions are like those of degrees.csv if they are radians, .*`mend="
    with pytest.raises(ValueError, match=said):
        read_logs([tmp_path], "auto", robot=arm)
    read = read_logs([tmp_path], "auto", robot=arm, mend="deg")
    assert np.abs(read["usual.csv"].trace.q[:, 0]).max() == pytest.approx(np.pi / 180, rel=0.01)
    turned(usual, speed=3.0, turns=0.3, motion_of_others=0.1)  # small motions: the others decide
    read = read_logs([tmp_path], "auto", robot=arm)
    assert np.abs(read["usual.csv"].trace.q[:, 0]).max() == pytest.approx(
        0.1 * np.pi / 180, rel=0.01
    )
    assert read["slow.csv"].trace.q[-1, 2] == pytest.approx(16.0 * np.pi / 180, rel=0.01)


def test_a_standing_log_in_radians_is_not_read_in_degrees(tmp_path):
    """It stands where another log, in degrees, begins."""
    arm, place = three_joints(tmp_path / "arm.xml"), np.array([1.6, -1.2, 0.9])
    t = 0.01 * np.arange(400)
    names = ["t", *(f"{name}{k}" for name in ("q", "qd", "tau") for k in range(3))]
    q = place + 0.3 * np.sin(t[:, None] + np.arange(3))
    noise = 0.001 * np.random.default_rng(0).standard_normal(q.shape)
    written(tmp_path / "a.csv", names, t, np.rad2deg(q), np.rad2deg(np.gradient(q, t, axis=0)), q)
    written(tmp_path / "b.csv", names, t, place + 0 * q, 0 * q, q)
    with pytest.raises(ValueError, match=r"b.csv: its positions are like those of a.csv"):
        read_logs([tmp_path], "auto", robot=arm)
    written(tmp_path / "b.csv", names, t, np.rad2deg([0.1, -0.1, 0.2]) + noise, 0 * q, q)
    read = read_logs([tmp_path], "auto", robot=arm)
    assert read["b.csv"].trace.q[0] == pytest.approx([0.1, -0.1, 0.2], abs=0.01)


@pytest.mark.data
def test_all_logs_of_a_ur3_are_in_radians(data_dir):
    files = sorted((data_dir / "ur3" / "free").glob("*.csv"))
    if not files:
        pytest.skip("no ur3 folder in the real data")
    for path in files:
        assert "[rad]" in next(
            n.text for n in read_log(path, "auto").findings if "read as" in n.text
        ), path


def test_a_note_on_several_logs_is_given_once(tmp_path):
    arm = three_joints(tmp_path / "arm.xml")
    for name in ("a", "b"):
        turned(tmp_path / f"{name}.csv", speed=3.0, turns=3.0)
    (note,) = read_logs([tmp_path], "auto", robot=arm).findings.of("columns")
    assert note.where == ("a.csv", "b.csv")
    assert note.text.startswith("each log: read as time t [s]")
    path = turned(tmp_path / "d.csv", speed=3.0, turns=3.0)
    path.write_text(path.read_text() + "4.0,1")
    (tail,) = read_logs([tmp_path], "auto", robot=arm).findings.of("rows-left-out")
    assert tail.text == "d.csv: line 402: cut off (2 of 10 columns), left out"


def test_degrees_are_those_of_revolute_joints(tmp_path):
    arm = tmp_path / "arm.xml"
    inner = '<inertial pos="0 0 .1" mass="1" diaginertia=".01 .01 .01"/>'
    bodies = "".join(
        f'<body pos="0 0 .3"><joint name="j{k}" type="{kind}"/>{inner}'
        for k, kind in enumerate(("slide", "hinge", "hinge"))
    )
    arm.write_text(f"<mujoco><worldbody>{bodies}{'</body>' * 3}</worldbody></mujoco>")
    log = turned(tmp_path / "a.csv", speed=3.0, scale=np.array([1.0, 57.3, 57.3]), turns=3.0)
    signals = {name: tuple(f"{name}{k}" for k in range(3)) for name in ("q", "qd")}
    torque = tuple(f"tau{k}" for k in range(3))
    mixed = ColumnMap("t", **signals, torque=torque, degrees=(False, True, True))
    _, table = np.split(np.loadtxt(log, delimiter=",", skiprows=1), [1], axis=1)
    trace = read_log(log, mixed).trace
    np.testing.assert_allclose(trace.q, table[:, :3] * [1.0, np.pi / 180, np.pi / 180])
    np.testing.assert_allclose(trace.qd[:, 0], table[:, 3])
    with pytest.raises(ValueError, match=r"a.csv: j0 is a linear axis, .* \"degrees\" is a list"):
        read_logs([log], "auto", robot=arm)
    turned(log, speed=3.0, turns=3.0)
    assert (
        read_logs([log], "auto", robot=arm)
        .findings[-1]
        .text.startswith("j0: linear, so its numbers are in m")
    )
    for wrong in ((False, True), (0, 1, 1)):
        with pytest.raises(ValueError, match=r"columns.degrees: .*(one value or 3|expected true)"):
            ColumnMap("t", **signals, torque=torque, degrees=wrong)
