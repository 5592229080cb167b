"""Logs as objects: what is written is read back, from files and from memory alike."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import tauguard as tg
from tauguard.datasets import ColumnMap
from tauguard.detectors.calibration.recording import motion_length
from tauguard.findings import ArgumentError, LogError, MismatchError
from tauguard.traces import Load, Trace

ARM = """
<mujoco><worldbody>
  <body name="a" pos="0 0 .3"><joint name="waist" axis="0 0 1"/>
    <geom type="capsule" size=".05" fromto="0 0 0 .4 0 0" mass="4"/>
    <body name="b" pos=".4 0 0"><joint name="elbow" axis="0 1 0"/>
      <geom type="capsule" size=".04" fromto="0 0 0 .3 0 0" mass="2"/></body></body>
</worldbody></mujoco>
"""


def motion(rows=400, seed=0):
    """Times [s], positions, velocities and currents of two joints at 100 Hz."""
    rng = np.random.default_rng(seed)
    t, w = np.arange(rows) / 100, rng.uniform(0.5, 2.0, 2)
    q = np.sin(t[:, None] * w)
    return t, q, w * np.cos(t[:, None] * w), rng.standard_normal(q.shape)


def header(joints=("waist", "elbow")):
    return ["t", *(f"{signal}_{joint}" for signal in ("q", "qd", "current") for joint in joints)]


def write(path, *parts, names=None):
    """A CSV file in which each number has the digits that give back its bits."""
    columns = [
        column for part in parts for column in np.array(part, ndmin=2).reshape(len(part), -1).T
    ]
    lines = [",".join(names or header())]
    lines += [",".join(map(repr, row)) for row in zip(*(c.tolist() for c in columns), strict=True)]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def arm(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    return path


def same(a, b):
    assert a.joint_names == b.joint_names
    for name, values in {"t": a.t, **a.signals}.items():
        np.testing.assert_array_equal(values, {"t": b.t, **b.signals}[name], strict=True)


def test_a_log_holds_the_numbers_that_were_written(tmp_path, arm):
    t, q, qd, i = motion()
    log = tg.read_log(
        write(tmp_path / "a.csv", t, q, qd, i), "auto", robot=arm, payload=(2, (0, 0, 0.1))
    )
    same(log.trace, Trace(("waist", "elbow"), t, q, qd, i))
    assert log.load == Load(2.0, (0.0, 0.0, 0.1))
    assert (log.name, log.path, log.robot, log.labels) == ("a.csv", tmp_path / "a.csv", arm, None)
    assert log.as_read.startswith("time t [s], positions q_waist to q_elbow [rad]")
    assert [finding.code for finding in log.findings] == ["columns"]
    assert log.findings[0].where == ("a.csv",)
    assert log.until(1.0).trace.t[-1] < 1.0 <= log.trace.t[100]


def test_a_frame_and_arrays_give_the_same_log_as_the_file(tmp_path, arm):
    pandas = pytest.importorskip("pandas")
    t, q, qd, i = motion()
    path = write(tmp_path / "a.csv", t, q, qd, i)
    file = tg.read_log(path, "auto", robot=arm)
    frame = pandas.DataFrame(np.column_stack([t, q, qd, i]), columns=header())
    in_memory = tg.read_log(frame, "auto", robot=arm, name="a.csv")
    same(file.trace, in_memory.trace)
    assert in_memory.findings == file.findings
    assert in_memory.to_dict() == file.to_dict()
    arrays = {"t": t, "q": q, "qd": qd, "current": i}
    same(file.trace, tg.read_log(arrays, joint_names=["waist", "elbow"]).trace)
    same(file.trace, tg.read_log(file.to_frame()).trace)  # it comes back whole
    same(file.trace, tg.read_log(file.trace).trace)
    logs = tg.read_logs({"a": frame, "b": file.to_frame()}, "auto", robot=arm)
    for log in logs.values():
        same(file.trace, log.trace)


@settings(max_examples=25, deadline=None)
@given(
    values=st.lists(st.tuples(st.floats(-1e-5, 1e-5), st.floats(-30, 30)), min_size=2, max_size=20),
    unit=st.sampled_from(["deg", "ms", "mA", None]),
)
def test_any_numbers_come_back_and_units_scale_them(values, unit, tmp_path_factory):
    q, i = (np.array(column)[:, None] for column in zip(*values, strict=True))
    t = 0.01 * np.arange(len(q))
    words = () if unit is None else unit
    columns = ColumnMap("t", ("q",), current=("i",))
    path = write(tmp_path_factory.mktemp("x") / "x.csv", t, q, i, names=["t", "q", "i"])
    wanted = {"t": t, "q": q, "current": i}
    scaled = {"deg": ("q", np.pi / 180), "ms": ("t", 1e-3), "mA": ("current", 1e-3)}.get(unit)
    if scaled:
        wanted[scaled[0]] = wanted[scaled[0]] * scaled[1]
    for log in (
        tg.read_log(path, columns, mend=words),
        tg.read_log({"t": t, "q": q, "current": i}, mend=words),
    ):
        for name, array in wanted.items():
            np.testing.assert_array_equal(getattr(log.trace, name), array)
        assert "no-velocities" in [finding.code for finding in log.findings]


def test_logs_are_a_table_with_loads_and_joints_in_the_robots_order(tmp_path, arm):
    t, q, qd, i = motion()
    parts = [t, *(x[:, ::-1] for x in (q, qd, i))]
    write(tmp_path / "a.csv", *parts, names=header(("elbow", "waist")))
    write(tmp_path / "b.csv", t, q, qd, i)
    logs = tg.read_logs(tmp_path, "auto", robot=arm, payload={"b": 1.5, "a.csv": None})
    assert list(logs) == ["a.csv", "b.csv"]
    assert logs.joint_names == ("waist", "elbow") == logs.numbers.joint_names
    same(logs["a.csv"].trace, logs["b.csv"].trace)
    assert [log.load for log in logs.values()] == [None, Load(1.5)]
    rows = logs.rows()
    moved = round(motion_length([logs["b.csv"]]), 1)
    assert rows[1] == {
        "log": "b.csv", "seconds": 4.0, "rate [Hz]": 100.0, "joints": 2, "moving [s]": moved,
        "load [kg]": 1.5, "contacts": None,
    }  # fmt: skip
    assert rows[0]["load [kg]"] == "unknown"
    assert list(logs.only(["b.csv"])) == ["b.csv"]
    text = str(logs)
    assert text.splitlines()[0] == "Logs(2 logs, 8 s, arm.xml, 1 finding)"
    assert "note [columns]: each log: read as time t [s]" in text
    page = logs._repr_html_()
    assert page.count("<tr>") == 3
    assert "each log: read as time t [s]" in page


def test_every_faulty_log_and_joint_is_named_at_once(tmp_path, arm):
    t, q, qd, i = motion()
    write(tmp_path / "a.csv", t, q, -qd, i)
    write(tmp_path / "b.csv", t, q, qd[:, ::-1], i)
    gap = np.where(np.arange(len(t)) < 200, t, t + 1.0)
    write(tmp_path / "c.csv", gap, q, qd, i)
    write(tmp_path / "d.csv", t, q, qd, i)
    with pytest.raises(LogError) as error:
        tg.read_logs(tmp_path, "auto", robot=arm)
    errors = [f for f in error.value.findings if f.severity == "error"]
    assert [(f.code, f.where) for f in errors] == [
        ("velocity-sign", ("a.csv", "waist", "elbow")),
        ("velocities", ("b.csv", "waist")),
        ("velocities", ("b.csv", "elbow")),
        ("gap", ("c.csv",)),
    ]
    assert "a.csv: waist, elbow: the velocity has the other sign" in str(error.value)


def test_labelled_contacts_of_all_logs_are_refused_together(tmp_path, arm):
    t, q, qd, i = motion()
    for name in ("a.csv", "b.csv"):
        write(tmp_path / name, t, q, qd, i, t > 3, names=[*header(), "contact"])
    with pytest.raises(LogError, match=r"a.csv: a column labels 1 contact .*b.csv: a column"):
        tg.read_logs(tmp_path, "auto", robot=arm)
    log = tg.read_log(tmp_path / "a.csv", "auto", robot=arm)
    assert log.contacts == 1
    assert log.labels == ((pytest.approx(3.01), pytest.approx(3.99)),)
    arrays = {"t": t, "q": q, "qd": qd, "current": i, "contact": t > 3}
    assert tg.read_log(arrays).labels == log.labels


def test_a_load_and_arguments_that_cannot_be_are_refused(tmp_path, arm):
    path = write(tmp_path / "a.csv", *motion())
    for payload, said in (
        ({"a": 2600}, r'`payload=\{"a": 2600\}`: 2600 kg, expected at most 100'),
        ({"a": (1, 2, 3)}, "expected kg, or"),
        ({"a": "heavy"}, "expected kg, or"),
        ({"a": -1}, "expected 0 or more"),
        ({"z": 1}, "no log 'z'; expected one of a.csv"),
    ):
        with pytest.raises(ArgumentError, match=said):
            tg.read_logs(path, "auto", robot=arm, payload=payload)
    with pytest.raises(ArgumentError, match="columns 'ur99': presets are ur10e"):
        tg.read_log(path, "ur99")
    with pytest.raises(ArgumentError, match='`mend="degrees"`: expected some of deg'):
        tg.read_log(path, "auto", mend="degrees")
    t, q, _, i = motion()
    for arrays, said in (
        ({"t": t, "q": q, "amps": i}, "arrays: amps; expected some of t, q"),
        ({"t": t[1:], "q": q, "current": i}, r"t has the shape \(399,\), expected \(400,\)"),
        ({"t": t, "q": q, "current": i[:, :1]}, r"current has the shape \(400, 1\)"),
        ({"q": q, "current": i}, "t is missing"),
        ({"t": t, "current": i}, "q is missing"),
        (3, "source: int; expected a path"),
    ):
        with pytest.raises(ArgumentError, match=said):
            tg.read_log(arrays)
    q[7, 1] = np.nan
    with pytest.raises(LogError, match="row 7, column 'q_1': nan, not finite"):
        tg.read_log({"t": t, "q": q, "current": i})
    with pytest.raises(MismatchError, match="the log's joints are x, y"):
        tg.read_logs({"a": Trace(("x", "y"), *motion())}, robot=arm)


def test_simulated_recordings_keep_their_truth_and_have_distinct_names():
    t, q, qd, i = motion()
    traces = [Trace(("a", "b"), t, q, qd, i, meta={"episode": "3"}) for _ in range(2)]
    logs = tg.simulated(traces)
    assert list(logs) == ["3", "3 (1)"]
    assert logs.robot is None
    assert logs["3"].trace is traces[0]
    with pytest.raises(ArgumentError, match="expected at least one"):
        tg.simulated([])
