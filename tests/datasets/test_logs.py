"""Logs of real arms: the numbers that are in the file, and one line for every fault."""

import dataclasses
import json

import numpy as np
import pytest
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import Writer as PlainWriter
from mcap_ros2.writer import Writer

from tauguard import read_logs
from tauguard.datasets import PRESETS, ColumnMap, read_log
from tauguard.traces import Trace, write_mcap
from tauguard.traces.mcap_container import walk
from tauguard.traces.trace import UR_JOINTS
from tests.detectors.synthetic_arm import XML

JOINT_STATE = """\
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
TWO = ColumnMap(t="t", q=("a", "b"), qd=("va", "vb"), current=("ia", "ib"))
TEXT = "t,a,b,va,vb,ia,ib\n0,1,2,3,4,5,6\n0.1,7,8,9,10,11,12\n0.3,1,1,1,1,1,1\n"


def write(tmp_path, text, name="log.csv"):
    (tmp_path / name).write_text(text)
    return tmp_path / name


def test_numbers_by_name(tmp_path):
    log = read_log(write(tmp_path, TEXT), TWO)
    assert log.findings == ()
    assert log.trace.joint_names == ("joint_1", "joint_2")
    np.testing.assert_array_equal(log.trace.t, [0, 0.1, 0.3])
    np.testing.assert_array_equal(log.trace.q, [[1, 2], [7, 8], [1, 1]])
    np.testing.assert_array_equal(log.trace.qd, [[3, 4], [9, 10], [1, 1]])
    np.testing.assert_array_equal(log.trace.current, [[5, 6], [11, 12], [1, 1]])
    assert log.trace.truth is None


@pytest.mark.parametrize(
    ("name", "cells", "touched"),
    [
        ("Label", ["0", "1.0", "1"], ((0.1, 0.3),)),
        ("collision", ["true", "False", "TRUE"], ((0.0, 0.0), (0.3, 0.3))),
        ("contact", ["0", "0", "0"], ()),
        ("contact", ["0", "0.4", "1"], None),  # a measured number is no label
        ("labels", ["0", "1", "1"], None),
    ],
)
def test_a_column_of_labels_says_when_something_touched(tmp_path, name, cells, touched):
    lines = [f"{line},{cell}" for line, cell in zip(TEXT.split(), [name, *cells], strict=True)]
    assert read_log(write(tmp_path, "\n".join(lines)), TWO).labels == touched


def test_labelled_contacts_are_no_free_motion(tmp_path):
    lines = [
        f"{line},{cell}" for line, cell in zip(TEXT.split(), ["label", "0", "1", "1"], strict=True)
    ]
    write(tmp_path, "\n".join(lines))
    columns = tmp_path / "columns.json"
    columns.write_text(json.dumps(dataclasses.asdict(TWO) | {"repair": []}))
    (tmp_path / "arm.xml").write_text(XML)
    with pytest.raises(ValueError, match=r"log.csv: a column labels 1 contact \(0.1 to 0.3 s"):
        read_logs([tmp_path / "log.csv"], str(columns), robot=tmp_path / "arm.xml")


def test_indices_units_and_names(tmp_path):
    text = TEXT.split("\n", 1)[1].replace(",", ";")
    columns = ColumnMap(
        t=0,
        q=(1, 2),
        qd=(3, 4),
        current=(5, 6),
        q_des=(2, 1),
        degrees=True,
        time_scale=1e-3,
        current_scale=(2.0, -1.0),
        separator=";",
    )
    trace = read_log(write(tmp_path, text), columns, joint_names=("elbow", "wrist")).trace
    assert trace.joint_names == ("elbow", "wrist")
    np.testing.assert_allclose(trace.t, [0, 1e-4, 3e-4])
    np.testing.assert_allclose(trace.q[0], np.pi / 180 * np.array([1, 2]))
    np.testing.assert_allclose(trace.q_des[0], np.pi / 180 * np.array([2, 1]))
    np.testing.assert_array_equal(trace.current, [[10, -6], [22, -12], [2, -1]])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "empty file"),
        (TEXT.replace("va", "speed"), "no column 'va'; the file has: t, a, b, speed"),
        (TEXT.replace("0.3", "0.05"), r"line 4: time goes back from 0\.1 to 0\.05 s"),
        (TEXT.replace("0.3", "0.1"), r"line 4: time 0\.1 s repeats"),
        (TEXT.replace("8", "nan"), "line 3, column 'b': nan, not finite"),
        (TEXT.replace("8", ""), "line 3, column 'b': '' is not a number"),
        (TEXT.replace("8", "off"), "line 3, column 'b': 'off' is not a number"),
        (TEXT.replace("12", "1e999"), "line 3, column 'ib': 1e999, not finite"),
        (TEXT.replace("10,11,12", "10"), "line 3: 5 columns, expected 7"),
        (TEXT[:-6], "line 4: 5 columns, expected 7"),
        (TEXT.split("\n")[0] + "\n", "a header line without rows of numbers"),
        (TEXT.split("\n")[0] + "\n0,1,2,3,4,5,6\n", "1 rows of numbers, expected at least 2"),
    ],
)
def test_faults_are_named_with_file_and_line(tmp_path, text, message):
    path = write(tmp_path, text)
    with pytest.raises(ValueError, match=rf"log\.csv: {message}"):
        read_log(path, TWO)


def test_repairs_only_where_the_map_says_so_and_tells(tmp_path):
    text = TEXT.replace("0.3", "0.1") + "0.4,2,2,2,2,2,nan\n0.5,3,3,3,3,3,3\n0.6,4,4"
    columns = dataclasses.replace(TWO, repair=frozenset({"repeat", "tail", "nan"}))
    log = read_log(write(tmp_path, text), columns)
    np.testing.assert_array_equal(log.trace.t, [0, 0.1, 0.5])
    assert len(log.findings) == 3
    assert any("line 7: cut off (3 of 7 columns)" in note.text for note in log.findings)
    assert any("first: line 4" in note.text for note in log.findings)
    assert any("first: line 5" in note.text for note in log.findings)
    back = text.replace("0.5,", "0.05,")
    with pytest.raises(ValueError, match="goes back"):
        read_log(write(tmp_path, back), columns)


def test_maps_that_make_no_sense():
    with pytest.raises(ValueError, match=r"columns\.qd: 1 columns for 2 joints"):
        ColumnMap(t=0, q=(1, 2), qd=(3,), current=(4, 5))
    with pytest.raises(ValueError, match="repair"):
        ColumnMap(t=0, q=(1,), qd=(3,), current=(4,), repair=frozenset({"magic"}))
    with pytest.raises(ValueError, match="current_scale"):
        ColumnMap(t=0, q=(1,), qd=(3,), current=(4,), current_scale=(1.0, 2.0))


def test_presets(tmp_path):
    rows = np.arange(3 * 31).reshape(3, 31) / 8
    text = "\n".join(",".join(map(str, row)) for row in rows)
    trace = read_log(write(tmp_path, text), "ur10e").trace
    np.testing.assert_array_equal(trace.t, rows[:, 0])
    np.testing.assert_array_equal(trace.current, rows[:, 13:19])
    assert trace.joint_names == UR_JOINTS
    ur5 = PRESETS["ur5"]
    named = ",".join(["t", *ur5.q, *ur5.qd, *ur5.current, *(f"x{k}" for k in range(12))])
    headed = write(tmp_path, f"{named}\n{text}", "headed.csv")
    with pytest.raises(ValueError, match=r"files of this column map have no header line: use ur5$"):
        read_log(headed, "ur10e")
    preset = PRESETS["ur_rtde"]
    header = ["timestamp", *preset.q, *preset.qd, "other", *preset.current]
    text = "\n".join([",".join(header), *(",".join(map(str, r[:20])) for r in rows)])
    trace = read_log(write(tmp_path, text, "rtde.csv")).trace  # found by its header
    np.testing.assert_array_equal(trace.qd, rows[:, 7:13])
    np.testing.assert_array_equal(trace.current, rows[:, 14:20])
    with pytest.raises(ValueError, match="presets are ur10e, ur_rtde"):
        read_log(tmp_path / "rtde.csv", "kuka")
    with pytest.raises(ValueError, match="no column map"):
        read_log(write(tmp_path, TEXT))
    with pytest.raises(ValueError, match="line 1: 7 columns, expected 31"):
        read_log(write(tmp_path, TEXT.split("\n", 1)[1]), "ur10e")


@pytest.mark.data
def test_every_real_file_reads(data_dir):
    files = sorted((data_dir / "ur10e").glob("*/*.csv"))
    assert files
    for file in files:
        trace = read_log(file, "ur10e").trace
        raw = np.loadtxt(file, delimiter=",")
        np.testing.assert_array_equal(trace.t, raw[:, 0])
        np.testing.assert_array_equal(trace.q, raw[:, 1:7])
        assert 0.009 < trace.dt < 0.011


def rosbag(path, rows, effort=True, names=("b", "a"), stamped=True, **options):
    """A bag as another program writes it: mcap-ros2-support's own encoder."""
    with open(path, "wb") as stream:
        writer = Writer(stream, **options)
        schema = writer.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE)
        for k in range(rows):
            ns = (10**9 + 8 * 10**6 * k) if stamped else 0
            message = {
                "header": {"stamp": {"sec": ns // 10**9, "nanosec": ns % 10**9}, "frame_id": "x"},
                "name": list(names),
                "position": [k + 0.25, k + 0.5],
                "velocity": [k + 1.25, k + 1.5],
                "effort": [k + 2.25, k + 2.5] if effort else [],
            }
            writer.write_message("/joint_states", schema, message, log_time=5 * 10**9 + k)
        writer.finish()


def test_a_bag_of_joint_states(tmp_path):
    rosbag(tmp_path / "a.mcap", 5)
    log = read_log(tmp_path / "a.mcap", joint_names=("a", "b"))
    np.testing.assert_allclose(log.trace.t, 1 + 0.008 * np.arange(5), rtol=1e-15)
    np.testing.assert_array_equal(log.trace.q[2], [2.5, 2.25])
    np.testing.assert_array_equal(log.trace.current[3], [5.5, 5.25])
    assert "effort is taken as current" in log.findings[0].text
    assert read_log(tmp_path / "a.mcap").trace.joint_names == ("b", "a")
    assert "columns" not in log.trace.meta
    assert read_log(tmp_path / "a.mcap", "ur5").trace.meta["columns"] == "ur5"  # for its gains
    rosbag(tmp_path / "b.mcap", 3, stamped=False)
    np.testing.assert_allclose(read_log(tmp_path / "b.mcap").trace.t[0], 5.0)


def test_bags_with_faults(tmp_path):
    rosbag(tmp_path / "a.mcap", 3, effort=False)
    with pytest.raises(ValueError, match=r"a\.mcap: /joint_states, message 0: effort holds 0"):
        read_log(tmp_path / "a.mcap")
    rosbag(tmp_path / "b.mcap", 3)
    with pytest.raises(ValueError, match="no joint 'elbow'; it has b, a"):
        read_log(tmp_path / "b.mcap", joint_names=("elbow",))
    data = (tmp_path / "b.mcap").read_bytes()
    for cut in (3, 100, len(data) - 5):
        (tmp_path / "c.mcap").write_bytes(data[:cut])
        with pytest.raises(ValueError, match=r"c\.mcap: .*(cut off|not an MCAP file)"):
            read_log(tmp_path / "c.mcap")
    with open(tmp_path / "d.mcap", "wb") as stream:
        Writer(stream).finish()
    with pytest.raises(ValueError, match="no topic of type"):
        read_log(tmp_path / "d.mcap")


def without(data, opcode):
    """The bytes of an MCAP file less its first record of a kind."""
    at, body = next((at, body) for at, code, body in walk(data) if code == opcode)
    return data[:at] + data[at + 9 + len(body) :]


def test_a_bag_is_read_by_its_data_not_by_its_index(tmp_path):
    """A chunk that the index at the end leaves out was missing without a word."""
    rosbag(tmp_path / "whole.mcap", 12, chunk_size=512)
    data = (tmp_path / "whole.mcap").read_bytes()
    (tmp_path / "index.mcap").write_bytes(without(data, Opcode.CHUNK_INDEX))
    whole, found = (read_log(tmp_path / f"{name}.mcap").trace for name in ("whole", "index"))
    assert np.array_equal(found.t, whole.t)
    assert np.array_equal(found.current, whole.current)
    (tmp_path / "chunk.mcap").write_bytes(without(data, Opcode.CHUNK))
    with pytest.raises(ValueError, match=r"chunk\.mcap: .*damaged"):
        read_log(tmp_path / "chunk.mcap")


def test_a_bag_without_chunks_reads_the_same(tmp_path):
    rosbag(tmp_path / "whole.mcap", 12)
    with open(tmp_path / "whole.mcap", "rb") as old, open(tmp_path / "bare.mcap", "wb") as new:
        writer = PlainWriter(new, use_chunking=False)
        writer.start("ros2")
        for schema, channel, one in make_reader(old).iter_messages():
            if not one.sequence:
                kind = writer.register_schema(schema.name, schema.encoding, schema.data)
                topic = writer.register_channel(channel.topic, channel.message_encoding, kind)
            writer.add_message(topic, one.log_time, one.data, one.publish_time, one.sequence)
        writer.finish()
    whole, bare = (read_log(tmp_path / f"{name}.mcap").trace for name in ("whole", "bare"))
    np.testing.assert_array_equal(bare.t, whole.t)
    np.testing.assert_array_equal(bare.current, whole.current)


def test_a_recording_of_our_own(tmp_path):
    t = np.arange(4) / 4
    trace = Trace(("a",), t, t[:, None] + 1, t[:, None] + 2, t[:, None] + 3)
    write_mcap(tmp_path / "a.mcap", trace)
    again = read_log(tmp_path / "a.mcap").trace
    np.testing.assert_array_equal(again.current, trace.current)
    assert again.joint_names == ("a",)


def test_a_wrong_preset_names_the_one_that_fits(tmp_path):
    names = ["t", *(f"{x}{k}" for x in ("q", "qd", "i") for k in range(1, 7))]
    rows = np.column_stack([np.arange(9) * 0.01, np.zeros((9, 18))])
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header=",".join(names), comments="")
    for wrong in ("ur3", "ur_rtde"):
        with pytest.raises(ValueError, match="the columns of the preset ur5"):
            read_log(tmp_path / "a.csv", wrong)
    assert read_log(tmp_path / "a.csv").trace.meta["columns"] == "ur5"
    np.savetxt(tmp_path / "b.csv", np.zeros((9, 31)), delimiter=",")
    with pytest.raises(ValueError, match="the columns of the preset ur10e"):
        read_log(tmp_path / "b.csv", "ur5")


def test_a_time_of_too_few_digits_is_named(tmp_path):
    """Seconds since 1970 in six digits: nearly every row repeats the time before."""
    t = 1.7e9 + 0.01 * np.arange(300)
    rows = [f"{a:.6g},{0.03 * k:.2f},2,3,0,5,6\n" for k, a in enumerate(t)]
    path = write(tmp_path, "t,a,b,va,vb,ia,ib\n" + "".join(rows))
    columns = dataclasses.replace(TWO, repair=frozenset({"repeat"}))
    with pytest.raises(
        ValueError, match=r'299 of 300 rows repeat .* too few digits; .* `mend="clock=HZ"`'
    ):
        read_log(path, columns)
    assert len(read_log(path, columns, mend=["clock=100"]).trace.t) == 300
