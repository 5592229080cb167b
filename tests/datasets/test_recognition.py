"""What a log's columns are is told from names and numbers; copies of one state are no samples."""

import numpy as np
import pytest

from tauguard import read_log
from tauguard.datasets.arm_logs import reduced
from tauguard.datasets.columns import PRESETS, ColumnMap
from tauguard.datasets.log_table import Options
from tauguard.datasets.logs import read_source
from tauguard.datasets.recognition import described, grouped, lacking, recognised
from tauguard.traces import Log, Trace


def motion(rows=400, dt=0.01, joints=2):
    t = dt * np.arange(rows)
    phase = np.arange(joints)
    q = 0.8 * np.sin(1.1 * t[:, None] + phase)
    return t, q, 0.88 * np.cos(1.1 * t[:, None] + phase), 3 * np.cos(t[:, None] + phase)


def written(path, names, *parts):
    table = np.column_stack(parts)
    np.savetxt(path, table, delimiter=",", fmt="%.10g", header=",".join(names), comments="")
    return path


def test_columns_are_grouped_by_their_last_number():
    found = grouped(
        ["time", "actual_q_0", "actual_q_1", "x1", "x3", "/j/effort[0]", "/j/effort[1]"]
    )
    assert found == {
        "actual_q": ("actual_q_0", "actual_q_1"),
        "/j/effort": ("/j/effort[0]", "/j/effort[1]"),
    }


def pairs(*names):
    """Two columns of each signal."""
    return [name.replace("#", str(k)) for name in names for k in range(2)]


FRANKA = ("q", "q_d", "dq", "tau_J", "dtau_J", "tau_ext_hat_filtered")
JOINT_STATE = ("position", "velocity", "effort")
UR = ("actual_q_#", "target_current_#", "actual_current_#")


@pytest.mark.parametrize(
    ("names", "fields"),
    [
        (
            ["duration", *pairs(*(f"state.{name}[#]" for name in FRANKA))],
            {"q": "state.q[1]", "qd": "state.dq[1]", "torque": "state.tau_J[1]"},
        ),
        (
            ["__time", *pairs(*(f"/joint_states/{name}[#]" for name in JOINT_STATE))],
            {
                "q": "/joint_states/position[1]",
                "qd": "/joint_states/velocity[1]",
                "torque": "/joint_states/effort[1]",
            },
        ),
        (["timestamp", *pairs(*UR)], {"q": "actual_q_1", "current": "actual_current_1"}),
    ],
)
def test_measured_signals_are_found_among_commanded_ones(names, fields):
    table = np.random.default_rng(0).uniform(-1, 1, (50, len(names)))
    table[:, 0] = 0.01 * np.arange(50)
    found = recognised(names, table)
    assert {name: group[1] for name, group in found.groups().items()} == fields


def test_nothing_is_proposed_where_something_lacks():
    table = np.zeros((5, 4))
    assert recognised(["t", "q1", "q2", "x"], table) is None
    assert recognised(["q1", "q2", "tau1", "tau2"], table) is None
    assert recognised(["t", "q1", "q2", "tau1"], table) is None


UR_NAMED = [f"{joint}_joint" for joint in ("shoulder_pan", "elbow", "wrist_1", "wrist_2")]


@pytest.mark.parametrize(
    ("names", "joints"),
    [
        ([f"J{k} {what}" for what in ("angle (rad)", "speed", "current [A]") for k in (1, 2)], ()),
        ([f"joint_{k}_{what}" for what in ("pos", "vel", "torque") for k in (1, 2)], ()),
        ([f"{j}_{w}" for w in ("position", "velocity", "current") for j in UR_NAMED], UR_NAMED),
    ],
)
def test_joints_stand_before_the_kind_of_signal(tmp_path, names, joints):
    """A UR's wrist_1 and wrist_2 are no arm of two joints."""
    t, *parts = motion(joints=len(names) // 3)
    log = read_log(written(tmp_path / "log.csv", ["# time [s]", *names], t, *parts), "auto")
    for found, given in zip((log.trace.q, log.trace.qd, log.trace.current), parts, strict=True):
        np.testing.assert_allclose(found, given, atol=1e-8)
    assert log.trace.joint_names == (tuple(joints) or ("joint_1", "joint_2"))


@pytest.mark.parametrize("given", ["auto", None, "ur3"])
@pytest.mark.parametrize(("separator", "decimal"), [(";", "."), ("\t", "."), (";", ",")])
def test_separators_and_decimal_commas_are_seen(tmp_path, separator, decimal, given):
    t, *parts = motion(joints=6)
    names = ["t", *(f"{name}{k}" for name in ("q", "qd", "tau") for k in range(1, 7))]
    path = written(tmp_path / "log.csv", names, t, *parts)
    text = path.read_text().replace(",", separator).replace(".", decimal)
    path.write_text(text)
    log = read_log(path, given)
    np.testing.assert_allclose(log.trace.current, parts[2], atol=1e-8)
    assert log.trace.meta["columns"] == "ur3"


def test_a_preset_s_columns_in_other_units_are_told_by_their_numbers(tmp_path):
    t, q, qd, i = motion(joints=6)
    names = ["t", *(f"{name}{k}" for name in ("q", "qd", "i") for k in range(1, 7))]
    parts = 1e3 * t, np.rad2deg(q), np.rad2deg(qd), 1e3 * i
    path = written(tmp_path / "log.csv", names, *parts)
    log = read_log(path, "auto")
    assert log.findings[0].text.startswith("log.csv: read as time t [ms], positions q1 to q6 [deg]")
    assert log.trace.meta["columns"] == "ur5"
    np.testing.assert_allclose(log.trace.q, q, atol=1e-8)
    np.testing.assert_allclose(log.trace.current, i, atol=1e-8)
    with pytest.raises(ValueError, match='say `mend="ms"`'):
        read_log(path, mend=("deg", "mA"))


def test_a_clock_that_was_set_back_is_no_matter_of_order(tmp_path):
    t, q, qd, i = motion()
    t[200:] -= 1.0
    path = written(tmp_path / "log.csv", ["t", *pairs("q#", "qd#", "current#")], t, q, qd, i)
    with pytest.raises(ValueError, match=r"line 202: the clock was set back by 0\.99 s: cut"):
        read_log(path, "auto")
    rows = np.r_[200:400, 0:200]  # two halves in the wrong order are sorted
    parts = (x[rows] for x in (0.01 * np.arange(400), q, qd, i))
    path = written(tmp_path / "halves.csv", ["t", *pairs("q#", "qd#", "current#")], *parts)
    np.testing.assert_allclose(read_log(path, "auto").trace.q, q, atol=1e-8)


@pytest.mark.parametrize("accepted", [False, True])
def test_units_and_order_are_proposed_and_read_when_accepted(tmp_path, accepted):
    t, q, qd, current = motion()
    order = np.random.default_rng(3).permutation(len(t))
    names = ["stamp", "pos_1", "pos_2", "vel_1", "vel_2", "current_1", "current_2"]
    parts = (1e3 * t, np.rad2deg(q), np.rad2deg(qd), 1e3 * current)
    path = written(tmp_path / "log.csv", names, *(part[order] for part in parts))
    if not accepted:
        with pytest.raises(ValueError, match='accept with `columns="auto"`') as error:
            read_log(path)
        assert "time stamp [ms], positions pos_1 to pos_2 [deg]" in str(error.value)
        assert "currents current_1 to current_2 [mA], rows sorted by time" in str(error.value)
        return
    log = read_log(path, "auto")
    np.testing.assert_allclose(log.trace.t, t, atol=1e-9)
    np.testing.assert_allclose(log.trace.q, q, atol=1e-8)
    np.testing.assert_allclose(log.trace.qd, qd, atol=1e-8)
    np.testing.assert_allclose(log.trace.current, current, atol=1e-8)
    assert log.findings[0].text.startswith("log.csv: read as time stamp [ms]")
    assert "were out of order" in log.findings[1].text


def test_copies_of_a_state_are_left_out_and_a_standing_arm_keeps_its_samples(tmp_path):
    t, q, qd, tau = motion(rows=600, dt=0.005)
    rows = np.arange(600)
    # A state every 10 ms, recorded every 5 ms; the arm stands still for half a second.
    source = np.where(rows < 300, rows, np.maximum(300, rows - 100)) // 2 * 2
    columns = ColumnMap(
        "t",
        ("q0", "q1"),
        ("v0", "v1"),
        torque=("f0", "f1"),
        repair=frozenset({"state"}),
    )
    names = ["t", *columns.q, *columns.qd, *columns.torque]
    speed = np.where((rows >= 300) & (rows < 400), 0.0, 1.0)[:, None] * qd[source]
    path = written(tmp_path / "log.csv", names, t, q[source], speed, tau[source])
    log = read_log(path, columns)
    # Every second row, but every third while it stands.
    assert len(log.trace.t) == pytest.approx(275, abs=10)
    assert np.diff(log.trace.t).max() <= 0.015 + 1e-9
    moving = log.trace.t < 1.5
    np.testing.assert_allclose(log.trace.t[moving], 0.01 * np.arange(moving.sum()), atol=1e-9)
    assert "58 % of the rows repeat the previous state" in log.findings[0].text


def test_a_fast_log_of_an_arm_that_rarely_repeats_keeps_all_rows(tmp_path):
    t, q, qd, tau = motion()
    source = np.arange(400)
    source[50:60] = 50
    names = ["time", "q0", "q1", "dq0", "dq1", "tau_J0", "tau_J1"]
    path = written(tmp_path / "log.csv", names, t, q[source], qd[source], tau[source])
    assert len(read_log(path, "auto").trace.t) == 400


def test_torques_of_the_other_sign_are_turned(tmp_path):
    t, q, qd, tau = motion()
    names = ["t", "q0", "q1", "v0", "v1", "f0", "f1"]
    path = written(tmp_path / "log.csv", names, t, q, qd, tau)
    signals = {"q": ("q0", "q1"), "qd": ("v0", "v1"), "torque": ("f0", "f1")}
    trace = read_log(path, ColumnMap("t", **signals, torque_scale=(-1.0, 1e-3))).trace
    np.testing.assert_allclose(trace.current, tau * [-1.0, 1e-3], atol=1e-8)
    for bad in (0.0, (1.0,), True):
        with pytest.raises(ValueError, match=r"torque_scale|scale.*other than 0"):
            ColumnMap("t", **signals, torque_scale=bad)


def test_a_map_is_said_in_one_line():
    columns = ColumnMap("t", ("a1", "a2"), torque=("b1", "b2"), time_scale=1e-9)
    assert described(columns) == (
        "time t [ns], positions a1 to a2 [rad], no velocities, joint torques b1 to b2 [N m]"
    )


@pytest.mark.data
@pytest.mark.parametrize(
    ("file", "preset", "share"),
    [("panda_touch/a4.csv", "franka", "55 %"), ("kuka_med7/joint_states.csv", "lbr", "75 %")],
)
def test_real_logs_of_arms_with_torque_sensors_are_recognised(data_dir, file, preset, share):
    if not (data_dir / file).is_file():
        pytest.skip(f"no {file} in the real data")
    log = read_log(data_dir / file)
    assert log.trace.meta["columns"] == preset
    assert log.trace.meta["effort"] == "torque"
    assert any(
        f"{share} of the rows repeat the previous state" in note.text for note in log.findings
    )
    assert log.trace.dt == pytest.approx(0.01, rel=0.05)


def test_names_of_joints_before_the_kind_of_signal_are_the_joints(tmp_path):
    """As tables of ROS's JointState have them; Franka's driver nests them in its state."""
    t, q, qd, i = motion()
    kinds = {"position": q, "velocity": qd, "effort": i}
    names = [f"/state/fr3_joint{k}/{kind}" for kind in kinds for k in (1, 2)]
    path = written(tmp_path / "log.csv", ["__time", *names], t, *kinds.values())
    trace = read_log(path, "auto").trace
    assert trace.joint_names == ("fr3_joint1", "fr3_joint2")
    assert trace.meta["effort"] == "torque"
    np.testing.assert_allclose(trace.current, i)


def test_torques_of_kuka_s_fri_have_the_other_sign_and_estimates_are_not_taken(tmp_path):
    t, q, _, i = motion()
    groups = {"external_torque": 0 * i, "measured_joint_position": q, "measured_torque": -i}
    names = [f"/lbr/state/{name}[{k}]" for name in groups for k in range(2)]
    path = written(tmp_path / "log.csv", ["time", *names], t, *groups.values())
    with pytest.raises(ValueError, match=r"measured_torque\[1\] \[N m, opposite sign\]"):
        read_log(path)
    np.testing.assert_allclose(read_log(path, "auto").trace.current, i)


@pytest.mark.parametrize("preset", ["libfranka", "doosan"])
def test_presets_of_makers_formats(tmp_path, preset):
    columns = PRESETS[preset]
    t, q, qd, i = motion(joints=len(columns.q))
    angle = 180 / np.pi if columns.degrees else 1.0
    names = [columns.t, *columns.q, *columns.qd, *columns.torque]
    parts = (t / columns.time_scale, angle * q, angle * qd, i)
    trace = read_log(written(tmp_path / "log.csv", names, *parts)).trace
    assert trace.meta["columns"] == preset
    for own, given in ((trace.t, t), (trace.q, q), (trace.qd, qd), (trace.current, i)):
        np.testing.assert_allclose(own, given, atol=1e-7)


def test_a_log_without_a_clock_gets_the_one_that_velocities_tell(tmp_path):
    t, q, qd, i = motion(dt=0.008)
    path = written(tmp_path / "log.csv", pairs("q#", "qd#", "current#"), q, qd, i)
    with pytest.raises(ValueError, match="no time, 125 rows per second by the velocities"):
        read_log(path)
    np.testing.assert_allclose(read_log(path, "auto").trace.t, t, rtol=1e-3)
    columns = ColumnMap("t", ("q0", "q1"), ("qd0", "qd1"), ("current0", "current1"))
    trace = read_log(path, columns, mend=("clock=125",)).trace
    np.testing.assert_allclose(trace.t, t, rtol=1e-9)


def test_what_is_wrong_with_a_log_is_named_with_the_word_that_mends_it(tmp_path):
    t, q, qd, i = motion()
    names = ["t", *pairs("q#", "qd#", "current#")]
    columns = ColumnMap("t", ("q0", "q1"), ("qd0", "qd1"), ("current0", "current1"))
    swapped = np.arange(len(t))
    swapped[[100, 101]] = [101, 100]
    cases = {
        "deg": (t, 57.3 * q + 60, 57.3 * qd, i),
        "order": tuple(x[swapped] for x in (t, q, qd, i)),
        "repeat": tuple(np.repeat(x, 2, axis=0) for x in (t, q, qd, i)),
    }
    for word, parts in cases.items():
        path = written(tmp_path / f"{word}.csv", names, *parts)
        with pytest.raises(ValueError, match=f'say `mend="{word}"`'):
            read_log(path, columns)
        np.testing.assert_allclose(read_log(path, columns, mend=(word,)).trace.current, i)
    path = written(tmp_path / "milli.csv", names, t, q, qd, 1000 * i)
    assert 'say `mend="mA"`' in str(read_log(path, columns).findings)
    np.testing.assert_allclose(read_log(path, columns, mend=("mA",)).trace.current, i)
    with pytest.raises(ValueError, match='`mend="grad"`: expected some of deg, rad, mA'):
        read_log(path, columns, mend=("grad",))


def test_a_reduced_log_has_nothing_folded_in_and_says_its_cost(tmp_path):
    """A line at 97 Hz would show at 3 Hz among samples of 100 Hz; means of 10 ms take it away."""
    t = np.arange(0, 4, 1e-3)
    slow, line = np.sin(2 * np.pi * 2 * t), np.sin(2 * np.pi * 97 * t)
    q = np.column_stack([slow, slow])
    trace = Trace(("a", "b"), t, q, 0 * q, q + np.column_stack([line, line]))
    log = reduced(Log(trace), 100.0)
    late = np.sin(2 * np.pi * 2 * (log.trace.t - 0.005))[:, None]
    assert np.abs(log.trace.current - late)[1:].max() < 0.05
    np.testing.assert_allclose(log.trace.q[1:], np.hstack([late, late])[1:], atol=2e-3)
    assert "1e+03 Hz averaged down to 100 Hz: alarms come 4.5 ms later" in log.findings[0].text
    with pytest.raises(ValueError, match="`resample=2000`: hz 2000 for a trace at 1000 Hz"):
        reduced(Log(trace), 2000.0)


RAIL = ("rail", "A1", "A2", "lift axis", "j.rot")


@pytest.mark.parametrize(
    ("q", "i"),
    [
        ("q_{}", "i_{}"),
        ("{}.position", "{}.current"),
        ("{} position [rad]", "{} current [A]"),
        ("pos_{}", "cur_{}"),
        ("{}_pos [rad]", "{}_Strom [A]"),
        ("state/{}/angle", "state/{}/amps"),
    ],
)
def test_names_of_the_robot_s_joints_decide_before_numbers(tmp_path, q, i):
    """A number within a name is no place in the row: the rail stands before A1."""
    t, *parts = motion(joints=5)
    order = [3, 1, 0, 4, 2]  # of the columns
    names = [*(q.format(RAIL[k]) for k in order), *(i.format(RAIL[k].upper()) for k in order)]
    values = (parts[0][:, order], parts[2][:, order])
    path = written(tmp_path / "log.csv", ["time [s]", *names], t, *values)
    trace = read_source(path, "log", Options("auto", robot_joints=RAIL)).trace
    assert trace.joint_names == RAIL
    np.testing.assert_allclose(trace.q, parts[0], atol=1e-8)
    np.testing.assert_allclose(trace.current, parts[2], atol=1e-8)


def test_joints_whose_name_is_part_of_another_s_are_told_apart():
    header = ["t", *(f"{name}_{w}" for w in ("q", "tau") for name in ("arm", "arm_2", "arm_21"))]
    table = np.arange(5.0)[:, None] * np.ones(len(header))
    found = recognised(header, table, joints=("arm_21", "arm", "arm_2"))
    assert found.q == ("arm_21_q", "arm_q", "arm_2_q")
    assert found.joint_names == ("arm_21", "arm", "arm_2")


def test_a_refusal_says_what_was_found_and_what_was_not(tmp_path):
    t, q, _, i = motion(joints=3)
    axes = ("rail", "A1", "A2")
    names = ["t", *(f"q_{a}" for a in axes), *(f"i_{a}" for a in axes)]
    path = written(tmp_path / "log.csv", names, t, q, i)
    said = r"found time: t; positions: q_A1 to q_A2 \(2\).*; not found: the joints of q_rail"
    with pytest.raises(ValueError, match=said):
        read_source(path, "log", Options("auto", robot_joints=("x", "y", "z")))
    said = lacking(names[:-1], axes)
    assert said.endswith("currents: i_rail to i_A1 (2); not found: currents of A2")
    assert lacking(["t", "a", "b"]) == (
        "found time: t; not found: positions and currents or torques"
    )
    (tmp_path / "empty.csv").write_text("")
    with pytest.raises(ValueError, match="the file is empty"):
        read_log(tmp_path / "empty.csv", "auto")


def test_a_unit_is_said_once():
    columns = ColumnMap("t [ms]", ("a [deg]", "b [deg]"), torque=("c", "d"), time_scale=1e-3)
    text = described(ColumnMap(**{**vars(columns), "degrees": True}))
    assert text.startswith("time t [ms], positions a [deg] to b [deg], no velocities")
