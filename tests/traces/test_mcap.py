"""Traces as MCAP: what is written comes back, and other programs read the same numbers."""

import dataclasses
import hashlib
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from tauguard.traces import Alarm, Collision, Detection, Trace, Truth, read_mcap, write_mcap


def make_trace(rows=50, joints=6, seed=0, obstacles=2, commanded=(1, 1, 1), truth=True):
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(1e-4, 2e-3, rows))
    table = lambda: rng.standard_normal((rows, joints))  # noqa: E731
    labels = truth and Truth(
        tau_ext=table(),
        contact_force=np.abs(rng.standard_normal(rows)),
        collisions=tuple(
            Collision(
                kind=kind,
                onset=float(rng.uniform(0, 9)),
                end=float(rng.uniform(9, 10)),
                link=int(rng.integers(1, joints + 1)),
                point=rng.standard_normal(3),
                force=rng.standard_normal(3),
                peak_tau=float(rng.uniform(0, 99)),
            )
            for kind in ("pulse", "strike", "clamp", "strike")
        ),
        payload=rng.uniform(0, 4, rows),
        contact_link=rng.integers(0, joints + 1, rows),
        contact_point=np.where(rng.random((rows, 1)) < 0.5, np.nan, 1.0) * np.ones((rows, 3)),
        contact_vector=rng.standard_normal((rows, 3)),
        obstacle_names=tuple(f"ball {i}" for i in range(obstacles)),
        obstacle_poses=rng.standard_normal((rows if obstacles else 0, obstacles, 4, 4)),
    )
    return Trace(
        joint_names=tuple(f"joint{'_' * i}{i + 1}" for i in range(joints)),
        t=t,
        q=table(),
        qd=table(),
        current=table(),
        **{
            name: table()
            for name, on in zip(("q_des", "qd_des", "qdd_des"), commanded, strict=True)
            if on
        },
        truth=labels or None,
        meta={"seed": str(seed), "mujoco": "4.0.0", "configuration": "ab" * 32, "empty": ""},
        attachments={"scene.xml": "<mujoco/>", "configuration.json": '{"ü": 1}', "none.txt": ""},
    )


def make_detection(trace, seed=1):
    rng = np.random.default_rng(seed)
    rows, joints = trace.q.shape
    return Detection(
        detector="svr",
        t=trace.t,
        residual=rng.standard_normal((rows, joints)),
        score=rng.standard_normal(rows),
        threshold=0.1 + 0.2,
        alarm=rng.random(rows) < 0.3,
        alarms=(Alarm(0.25, 0.5), Alarm(1 / 3, 2 / 3)),
    )


def same(a, b):
    """Equality of two values, arrays bit by bit and type by type."""
    if dataclasses.is_dataclass(a):
        assert type(a) is type(b)
        for field in dataclasses.fields(a):
            same(getattr(a, field.name), getattr(b, field.name))
    elif isinstance(a, np.ndarray):
        assert a.dtype == b.dtype
        assert a.shape == b.shape
        assert a.tobytes() == b.tobytes()
    elif isinstance(a, tuple):
        assert len(a) == len(b)
        for left, right in zip(a, b, strict=True):
            same(left, right)
    else:
        assert a == b
        assert type(a) is type(b)


@settings(max_examples=60, deadline=None)
@given(
    rows=st.integers(0, 40),
    joints=st.integers(1, 9),
    obstacles=st.integers(0, 3),
    commanded=st.tuples(st.booleans(), st.booleans(), st.booleans()),
    truth=st.booleans(),
    detected=st.booleans(),
    seed=st.integers(0, 99),
)
@example(rows=0, joints=1, obstacles=1, commanded=(True,) * 3, truth=True, detected=True, seed=0)
def test_read_back_equal(
    tmp_path_factory, rows, joints, obstacles, commanded, truth, detected, seed
):
    path = tmp_path_factory.mktemp("trace") / "a.mcap"
    trace = make_trace(rows, joints, seed, obstacles, commanded, truth)
    detection = make_detection(trace) if detected else None
    write_mcap(path, trace, detection)
    same(dataclasses.replace(trace, detection=detection), read_mcap(path))


def test_several_chunks_read_back_equal_and_other_sizes(tmp_path):
    trace = make_trace(rows=20_000)  # above 4 MiB of messages
    detection = make_detection(trace)
    write_mcap(tmp_path / "a.mcap", trace, detection)
    same(dataclasses.replace(trace, detection=detection), read_mcap(tmp_path / "a.mcap"))


def test_extreme_numbers_keep_their_bits(tmp_path):
    trace = make_trace(rows=4)
    q = trace.q.copy()
    q[0] = [-0.0, 5e-324, -1.7976931348623157e308, np.nextafter(1, 2), 0.1, 1e-310]
    trace = dataclasses.replace(trace, q=q, t=np.array([0.0, 5e-324, 1e-12, 9e9]))
    write_mcap(tmp_path / "a.mcap", trace)
    same(trace, read_mcap(tmp_path / "a.mcap"))


def test_equal_traces_are_equal_bytes(tmp_path):
    digests = set()
    for name in ("a.mcap", "b.mcap"):
        trace = make_trace()
        write_mcap(tmp_path / name, trace, make_detection(trace))
        digests.add(hashlib.sha256((tmp_path / name).read_bytes()).hexdigest())
        time.sleep(0.01)
    assert len(digests) == 1
    write_mcap(tmp_path / "c.mcap", make_trace(seed=1))
    assert hashlib.sha256((tmp_path / "c.mcap").read_bytes()).hexdigest() not in digests


def decoded(path):
    """All messages by topic through the mcap and mcap-ros2-support packages alone."""
    topics = {}
    with open(path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, message, value in reader.iter_decoded_messages():
            topics.setdefault(channel.topic, []).append((message, value))
    return topics


def test_mcap_ros2_support_reads_the_same_numbers(tmp_path):
    trace = make_trace(rows=30)
    detection = make_detection(trace)
    write_mcap(tmp_path / "a.mcap", trace, detection)
    topics = decoded(tmp_path / "a.mcap")
    truth = trace.truth
    for k, (message, state) in enumerate(topics["/joint_states"]):
        assert tuple(state.name) == trace.joint_names
        assert list(state.position) == trace.q[k].tolist()
        assert list(state.velocity) == trace.qd[k].tolist()
        assert list(state.effort) == []
        assert message.log_time == round(trace.t[k] * 1e9)
        assert state.header.stamp.sec * 10**9 + state.header.stamp.nanosec == message.log_time
    for k, (_, value) in enumerate(topics["/motor_currents"]):
        assert value.time == trace.t[k]
        assert list(value.current) == trace.current[k].tolist()
    for k, (_, value) in enumerate(topics["/joint_command"]):
        assert list(value.position) == trace.q_des[k].tolist()
        assert list(value.velocity) == trace.qd_des[k].tolist()
        assert list(value.acceleration) == trace.qdd_des[k].tolist()
    for k, (_, value) in enumerate(topics["/truth/contact"]):
        assert list(value.tau_ext) == truth.tau_ext[k].tolist()
        assert value.contact_force == truth.contact_force[k]
        assert value.payload == truth.payload[k]
        assert value.link == truth.contact_link[k]
        point = [value.point.x, value.point.y, value.point.z]
        np.testing.assert_array_equal(point, truth.contact_point[k])
        assert [value.force.x, value.force.y, value.force.z] == truth.contact_vector[k].tolist()
    for k, (_, value) in enumerate(topics["/truth/obstacles"]):
        assert tuple(value.name) == truth.obstacle_names
        assert list(value.pose) == truth.obstacle_poses[k].ravel().tolist()
    assert len(topics["/truth/collisions"]) == len(truth.collisions)
    by_onset = sorted(truth.collisions, key=lambda c: c.onset)
    for (_, value), collision in zip(topics["/truth/collisions"], by_onset, strict=True):
        assert (value.onset, value.end, value.link) == (
            collision.onset,
            collision.end,
            collision.link,
        )
        assert ("strike", "clamp", "pulse")[value.kind] == collision.kind
        assert [value.force.x, value.force.y, value.force.z] == collision.force.tolist()
    for k, (_, value) in enumerate(topics["/detection"]):
        assert list(value.residual) == detection.residual[k].tolist()
        assert (value.score, value.alarm) == (detection.score[k], bool(detection.alarm[k]))
        assert value.threshold == detection.threshold
    spans = [(value.start, value.end) for _, value in topics["/detection/alarms"]]
    assert spans == [(a.start, a.end) for a in detection.alarms]


def test_metadata_and_attachments_for_other_readers(tmp_path):
    trace = make_trace()
    write_mcap(tmp_path / "a.mcap", trace)
    with open(tmp_path / "a.mcap", "rb") as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == "ros2"
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        attachments = {record.name: record.data for record in reader.iter_attachments()}
        statistics = reader.get_summary().statistics
    assert metadata["tauguard.meta"] == trace.meta
    assert attachments == {name: text.encode() for name, text in trace.attachments.items()}
    assert statistics.message_count == 5 * len(trace.t) + len(trace.truth.collisions)
    assert statistics.message_start_time == min(
        round(trace.t[0] * 1e9), min(round(c.onset * 1e9) for c in trace.truth.collisions)
    )


def test_rerun_finds_nothing_to_complain_about(tmp_path):
    rerun = Path(sys.executable).with_name("rerun")
    trace = make_trace(rows=20_000)
    write_mcap(tmp_path / "a.mcap", trace, make_detection(trace))
    done = subprocess.run(
        [rerun, "mcap", "check", tmp_path / "a.mcap"],
        capture_output=True,
        text=True,
        env=os.environ | {"RERUN_ANALYTICS": "0"},
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_file_rewritten_message_by_message_reads_the_same(tmp_path):
    """Another writer's chunks: all of one topic, then all of the next, other compression."""
    from mcap.writer import CompressionType, Writer

    trace = make_trace(rows=300)
    detection = make_detection(trace)
    write_mcap(tmp_path / "a.mcap", trace, detection)
    with open(tmp_path / "a.mcap", "rb") as source, open(tmp_path / "b.mcap", "wb") as target:
        reader = make_reader(source)
        writer = Writer(target, chunk_size=10_000, compression=CompressionType.LZ4)
        writer.start("ros2", "another")
        rows = sorted(reader.iter_messages(), key=lambda row: row[1].topic)
        ids = {}
        for schema, channel, message in rows:
            if channel.id not in ids:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                ids[channel.id] = writer.register_channel(channel.topic, "cdr", number)
            writer.add_message(ids[channel.id], message.log_time, message.data, 0, message.sequence)
        for record in reader.iter_attachments():
            writer.add_attachment(1, 2, record.name, record.media_type, record.data)
        for record in reader.iter_metadata():
            writer.add_metadata(record.name, record.metadata)
        writer.finish()
    same(dataclasses.replace(trace, detection=detection), read_mcap(tmp_path / "b.mcap"))


def test_every_cut_is_noticed(tmp_path):
    write_mcap(tmp_path / "a.mcap", make_trace())
    data = (tmp_path / "a.mcap").read_bytes()
    cuts = [0, 1, 7, 8, 9, 100, len(data) // 2, len(data) - 9, len(data) - 8, len(data) - 1]
    for cut in cuts:
        (tmp_path / "cut.mcap").write_bytes(data[:cut])
        with pytest.raises(ValueError, match=r"cut\.mcap: (cut off|no closing|not an MCAP)"):
            read_mcap(tmp_path / "cut.mcap")


def test_a_flipped_bit_in_the_messages_is_noticed(tmp_path):
    write_mcap(tmp_path / "a.mcap", make_trace())
    data = bytearray((tmp_path / "a.mcap").read_bytes())
    data[len(data) // 3] ^= 1
    (tmp_path / "b.mcap").write_bytes(data)
    with pytest.raises(ValueError, match=r"b\.mcap: .*damaged chunk at byte \d+"):
        read_mcap(tmp_path / "b.mcap")


def test_foreign_files_are_named(tmp_path):
    (tmp_path / "a.csv").write_text("t,q\n0,1\n")
    with pytest.raises(ValueError, match=r"a\.csv: not an MCAP file.*read_log"):
        read_mcap(tmp_path / "a.csv")
    with pytest.raises(FileNotFoundError):
        read_mcap(tmp_path / "missing.mcap")


def test_nothing_half_written_replaces_a_whole_file(tmp_path):
    trace = make_trace()
    path = tmp_path / "a.mcap"
    write_mcap(path, trace)
    before = path.read_bytes()
    bad = dataclasses.replace(trace.truth, payload=np.zeros(3))
    with pytest.raises(ValueError, match=r"payload: shape \(3,\), expected \(50,\)"):
        write_mcap(path, dataclasses.replace(trace, truth=bad))
    unencodable = dataclasses.replace(trace, attachments={"a": "\ud800"})
    with pytest.raises(ValueError, match="surrogates"):
        write_mcap(path, unencodable)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["a.mcap"]
    with pytest.raises(OSError, match="nowhere"):
        write_mcap(tmp_path / "nowhere" / "a.mcap", trace)


def test_times_that_mcap_cannot_hold(tmp_path):
    trace = make_trace(rows=3, truth=False)
    early = dataclasses.replace(trace, t=np.array([-1.0, 0.0, 1.0]))
    with pytest.raises(ValueError, match=r"t: -1\.0 s in row 0"):
        write_mcap(tmp_path / "a.mcap", early)
    detection = dataclasses.replace(make_detection(trace), t=trace.t + 1)
    with pytest.raises(ValueError, match=r"detection\.t"):
        write_mcap(tmp_path / "a.mcap", trace, detection)


def test_filtered_messages_are_missed(tmp_path):
    """A file that keeps the metadata and drops messages is not taken for a whole one."""
    from mcap.writer import Writer

    write_mcap(tmp_path / "a.mcap", make_trace(truth=False))
    with open(tmp_path / "a.mcap", "rb") as source, open(tmp_path / "b.mcap", "wb") as target:
        reader = make_reader(source)
        writer = Writer(target)
        writer.start("ros2", "another")
        for record in reader.iter_metadata():
            writer.add_metadata(record.name, record.metadata)
        writer.finish()
    with pytest.raises(ValueError, match="/joint_states: 0 messages, expected 50"):
        read_mcap(tmp_path / "b.mcap")


def test_written_faster_than_a_robot_talks(tmp_path):
    """60 s at 1 kHz on six topics; the floor is 50,000 messages a second."""
    trace = make_trace(rows=60_000, obstacles=1)
    detection = make_detection(trace)
    start = time.perf_counter()
    write_mcap(tmp_path / "a.mcap", trace, detection)
    seconds = time.perf_counter() - start
    assert 6 * len(trace.t) / seconds > 50_000
    start = time.perf_counter()
    read_mcap(tmp_path / "a.mcap")
    assert 6 * len(trace.t) / (time.perf_counter() - start) > 50_000


def test_form_record_is_json(tmp_path):
    write_mcap(tmp_path / "a.mcap", make_trace())
    with open(tmp_path / "a.mcap", "rb") as stream:
        records = {r.name: r.metadata for r in make_reader(stream).iter_metadata()}
    assert json.loads(records["tauguard.trace"]["rows"]) == 50
