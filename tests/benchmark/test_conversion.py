"""Conversion of small originals by hand, and of the published ones against their known hashes."""

import hashlib
import struct

import pytest

from tauguard.benchmark.conversion import CONVERSIONS
from tauguard.benchmark.manifest import is_complete, sets
from tauguard.findings import FileError


def test_a_table_without_header_keeps_its_first_columns():
    rows = [[10.5 + k, *range(1, 31)] for k in range(2)]
    table = "".join(",".join(map(str, row)) + "\n" for row in rows).encode()
    head, first, second = CONVERSIONS["ur10e_pushed"]([table]).decode().splitlines()
    assert head.startswith("t,q1,q2")
    assert head.endswith("i5,i6")
    assert first == "0," + ",".join(map(str, range(1, 19)))
    assert second.startswith("1,1,2,")


def six(rows, last=""):
    lines = [",".join([f"{0.008 * k:.6f}", *(f"{j + k}" for j in range(6))]) for k in range(rows)]
    return ("\n".join(lines) + "\n" + last).encode()


def test_tables_are_joined_by_row_up_to_the_shortest_and_a_cut_row_is_left_out():
    made = CONVERSIONS["ur5"]([six(4), six(5), six(3, "0.024,1,2"), six(4), six(4), six(4)])
    head, *rows = made.decode().splitlines()
    assert len(rows) == 3
    assert head.split(",")[0::6] == ["t", "q6", "qd6", "i6", "i_target6", "m_target6"]
    assert rows[2].split(",")[:3] == ["0.0160", "2.00000", "3.00000"]


def test_the_force_is_at_the_arm_s_times_less_its_first_mean():
    force = "".join(f"{0.004 * k:.3f},{k},0,0,0,0,0\n" for k in range(2000)).encode()
    tables = [six(150)] * 6
    made = CONVERSIONS["ur5"]([*tables, force, b"100.5\n", b"100.0\n"])
    head, *rows = made.decode().splitlines()
    assert head.endswith("Fx,Fy,Fz,Tx,Ty,Tz")
    at = [float(row.split(",")[31]) for row in rows]
    # The sensor's clock is 0.5 s later: its row k is at 0.5 s + 0.004 k s, and before that row 0.
    exact = [max((0.008 * k - 0.5) / 0.004, 0.0) for k in range(150)]
    mean = sum(exact[:100]) / 100
    assert at == pytest.approx([x - mean for x in exact], abs=6e-5)


def test_joints_of_the_med_7_come_in_the_arm_s_order():
    names = ["time", *(f"lbr_joint_{k}" for k in (1, 2, 3, 0, 4, 5, 6))]
    table = (",".join(names) + "\n5.0,1,2,3,0,4,5,6\n").encode()
    head, row = CONVERSIONS["kuka_med7"]([table] * 3).decode().splitlines()
    assert head.startswith("t,q1,")
    assert row == "0," + ",".join(["0,1,2,3,4,5,6"] * 3)
    late = table.replace(b"5.0", b"5.1")
    with pytest.raises(FileError, match="differ in time"):
        CONVERSIONS["kuka_med7"]([table, late, table])


def sized(content):
    return struct.pack("<I", len(content)) + content


def record(data, **fields):
    head = b"".join(sized(name.encode() + b"=" + value) for name, value in fields.items())
    return sized(head) + sized(data)


def message(seconds, q, at):
    arrays = b"".join(struct.pack("<I6d", 6, *x) for x in (q, [0.5] * 6, [2.0] * 6))
    names = struct.pack("<I", 6) + b"".join(sized(b"joint") for _ in range(6))
    state = struct.pack("<III", 7, seconds, 500_000_000) + sized(b"base") + names + arrays
    return record(state, op=b"\x02", conn=bytes(4), time=struct.pack("<II", *at))


def test_a_bag_is_read_in_the_order_of_its_recording():
    chunk = message(3, [3.0] * 6, (9, 5)) + message(2, [2.0] * 6, (9, 4))
    bag = b"#ROSBAG V2.0\n" + record(b" " * 40, op=b"\x03")
    bag += record(chunk, op=b"\x05", compression=b"none", size=struct.pack("<I", len(chunk)))
    head, *rows = CONVERSIONS["ur3"]([bag]).decode().splitlines()
    assert head.startswith("t,q1,")
    assert [row.split(",")[:2] for row in rows] == [
        ["0.000000", "2.000000"],
        ["1.000000", "3.000000"],
    ]
    assert rows[0].endswith(",-2.000000")
    with pytest.raises(FileError, match="bz2"):
        CONVERSIONS["ur3"]([bag.replace(b"=none", b"=bz2 ")])
    with pytest.raises(FileError, match="not a ROS 1 bag"):
        CONVERSIONS["ur3"]([b"#ROSBAG V1.2\n"])


@pytest.mark.data
@pytest.mark.parametrize("name", ["ur10e_pushed", "ur5", "ur3", "kuka_med7", "panda_touch"])
def test_published_originals_give_the_known_hashes(name, data_dir):
    one, store = sets()[name], data_dir / "originals" / name
    if not all(is_complete(store, original) for original in one.originals):
        pytest.skip("no originals: `tauguard data fetch all` keeps them beside the logs")
    for log in one.converted:
        contents = [(store / path).read_bytes() for path in log.originals]
        made = CONVERSIONS[one.conversion](contents)
        assert hashlib.sha256(made).hexdigest() == log.sha256, log.path
