"""Write a trace as an MCAP file of ROS 2 messages, and read it back with equal bits.

Topics: ``/joint_states`` (``sensor_msgs/msg/JointState``), ``/motor_currents``, ``/joint_command``,
``/truth/contact``, ``/truth/obstacles``, ``/truth/collisions``, ``/detection``,
``/detection/alarms`` and ``/contacts/CHECKER`` (package ``tauguard_msgs``). The metadata record
``tauguard.meta`` contains :attr:`Trace.meta`; :attr:`Trace.attachments` are MCAP attachments. Log
times are the times of the trace. Equal traces give equal bytes: the file does not depend on when or
where it was written.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tauguard.atomic_write import atomic_file
from tauguard.traces import mcap_contacts
from tauguard.traces.mcap_cdr import Anything, Layout
from tauguard.traces.mcap_container import Contents, Group, Topic
from tauguard.traces.mcap_schemas import SCHEMAS
from tauguard.traces.mcap_time import nanoseconds, stamp
from tauguard.traces.mcap_writer import Writer
from tauguard.traces.trace import KINDS, Alarm, Collision, Detection, Trace, Truth
from tauguard.untrusted_input import reading

FORMAT = "1"
LIBRARY = f"tauguard traces {FORMAT}"
MEDIA_TYPES = {".xml": "text/xml", ".json": "application/json", ".toml": "application/toml"}


def write_mcap(path: str | Path, trace: Trace, detection: Detection | None = None) -> None:
    """Write a trace, and a detector's output for it, as one MCAP file.

    ``detection`` defaults to ``trace.detection``. An existing file is replaced atomically: the new
    one is written in the same folder and renamed.

    Raises:
        ValueError: a field of the wrong shape, a time below 0 or after the year 2262, or a
            detection whose times are not those of the trace.
        OSError: the folder is missing or cannot be written.
    """
    path = Path(path)
    detection = trace.detection if detection is None else detection
    groups = [Group(nanoseconds(trace.t), sample_topics(trace, detection))]
    if trace.truth is not None and trace.truth.collisions:
        groups.append(collision_group(trace.truth.collisions))
    if detection is not None and detection.alarms:
        groups.append(alarm_group(detection.alarms))
    groups += [mcap_contacts.group(one) for one in trace.contacts if len(one)]
    with atomic_file(path) as stream:
        writer = Writer(stream, LIBRARY, SCHEMAS)
        writer.metadata("tauguard.meta", trace.meta)
        writer.metadata("tauguard.trace", describe(trace, detection))
        for name, text in sorted(trace.attachments.items()):
            media_type = MEDIA_TYPES.get(Path(name).suffix, "text/plain")
            writer.attachment(name, media_type, text.encode())
        for group in groups:
            writer.group(group)
        writer.finish()


def read_mcap(path: str | Path) -> Trace:
    """Read a file of :func:`write_mcap`; all arrays have the bits that were written.

    The detector's output is in ``Trace.detection``. Without obstacles, ``obstacle_poses`` has its
    default shape (0, 0, 4, 4).

    Raises:
        ValueError: not a file of :func:`write_mcap`, or truncated, damaged, or with messages
            missing. The message is one line: what is wrong, where, and what would work.
        OSError: the file is missing or cannot be read.
    """
    path = Path(path)
    expected = (
        "expected a complete MCAP file written by tauguard "
        "(logs of other programs: tauguard.datasets.read_log)"
    )
    with reading(path, expected):
        return decode(Contents(path.read_bytes()))


def describe(trace: Trace, detection: Detection | None) -> dict[str, str]:
    """Metadata from which the reader derives the layouts of the messages."""
    form: dict[str, Any] = {
        "format": FORMAT,
        "joint_names": trace.joint_names,
        "commanded": [name for name in COMMANDED if getattr(trace, name) is not None],
        "truth": trace.truth is not None,
        "obstacle_names": trace.truth.obstacle_names if trace.truth is not None else (),
        "rows": len(trace.t),
    }
    if detection is not None:
        form |= {"detector": detection.detector, "threshold": float(detection.threshold).hex()}
    if trace.contacts:
        form["checkers"] = mcap_contacts.describe(trace.contacts)
    return {name: json.dumps(value) for name, value in form.items()}


COMMANDED = ("q_des", "qd_des", "qdd_des")


def layouts(form: Mapping[str, Any]) -> list[Topic]:
    """The topics with one message per sample, in the order of writing; ``values`` are empty."""
    names, joints = form["joint_names"], len(form["joint_names"])
    state = Layout().header().strings(names)
    state.sequence("q", joints).sequence("qd", joints).sequence("effort", 0)
    current = Layout().header().number("time", "f8").sequence("current", joints)
    topics = [
        Topic("/joint_states", "sensor_msgs/msg/JointState", state),
        Topic("/motor_currents", "tauguard_msgs/msg/MotorCurrents", current),
    ]
    if form["commanded"]:
        command = Layout().header()
        for name in COMMANDED:
            command.sequence(name, joints if name in form["commanded"] else 0)
        topics.append(Topic("/joint_command", "tauguard_msgs/msg/JointCommand", command))
    if form["truth"]:
        contact = Layout().header().sequence("tau_ext", joints)
        contact.number("contact_force", "f8").number("payload", "f8").number("contact_link", "i8")
        contact.number("contact_point", "f8", 3).number("contact_vector", "f8", 3)
        topics.append(Topic("/truth/contact", "tauguard_msgs/msg/ContactTruth", contact))
    if form["obstacle_names"]:
        obstacles = Layout().header().strings(form["obstacle_names"])
        obstacles.sequence("obstacle_poses", 16 * len(form["obstacle_names"]))
        topics.append(Topic("/truth/obstacles", "tauguard_msgs/msg/Obstacles", obstacles))
    if "detector" in form:
        said = Layout().header().number("time", "f8").sequence("residual", joints)
        said.number("score", "f8").number("threshold", "f8").number("alarm", "?")
        topics.append(Topic("/detection", "tauguard_msgs/msg/Detection", said))
    return topics


def sample_topics(trace: Trace, detection: Detection | None) -> list[Topic]:
    """The topics of :func:`layouts` with the trace's and the detection's values."""
    values: dict[str, Anything] = stamp(trace.t) | {
        "time": trace.t,
        "q": trace.q,
        "qd": trace.qd,
        "current": trace.current,
    }
    values |= {n: getattr(trace, n) for n in COMMANDED if getattr(trace, n) is not None}
    if trace.truth is not None:
        truth = trace.truth
        fields = "tau_ext", "contact_force", "payload", "contact_link", "contact_point"
        values |= {name: getattr(truth, name) for name in (*fields, "contact_vector")}
        if truth.obstacle_names:
            shape = (len(trace.t), len(truth.obstacle_names), 4, 4)
            if truth.obstacle_poses.shape != shape:
                raise ValueError(
                    f"truth.obstacle_poses: shape {truth.obstacle_poses.shape}, expected {shape}"
                )
            values["obstacle_poses"] = truth.obstacle_poses.reshape(
                len(trace.t), 16 * len(truth.obstacle_names)
            )
    if detection is not None:
        if not np.array_equal(detection.t, trace.t):
            raise ValueError("detection.t: differs from trace.t; expected one row per sample")
        values |= {name: getattr(detection, name) for name in ("residual", "score", "alarm")}
        values["threshold"] = np.full(len(trace.t), detection.threshold)
    form = {name: json.loads(text) for name, text in describe(trace, detection).items()}
    topics = layouts(form)
    for topic in topics:
        for name in topic.layout.dtype.names or ():
            expected = (len(trace.t), *topic.layout.dtype[name].shape)
            if values[name].shape != expected:
                raise ValueError(f"{name}: shape {values[name].shape}, expected {expected}")
    return [
        Topic(
            topic.name,
            topic.schema,
            topic.layout,
            {name: values[name] for name in topic.layout.dtype.names or ()},
        )
        for topic in topics
    ]


def collision_layout() -> Layout:
    """The layout of ``tauguard_msgs/msg/Collision``."""
    layout = Layout().header().number("onset", "f8").number("end", "f8").number("peak_tau", "f8")
    return (
        layout.number("link", "i8")
        .number("point", "f8", 3)
        .number("force", "f8", 3)
        .number("kind", "u1")
    )


def collision_group(collisions: tuple[Collision, ...]) -> Group:
    """The labelled collisions, logged at their onsets.

    Raises:
        ValueError: an unknown kind.
    """
    for collision in collisions:
        if collision.kind not in KINDS:
            raise ValueError(f"collision kind {collision.kind!r}: one of {', '.join(KINDS)}")
    onset = np.array([c.onset for c in collisions], np.float64)
    values: dict[str, Anything] = stamp(onset) | {
        "onset": onset,
        "end": np.array([c.end for c in collisions], np.float64),
        "peak_tau": np.array([c.peak_tau for c in collisions], np.float64),
        "link": np.array([c.link for c in collisions], np.int64),
        "point": np.array([c.point for c in collisions], np.float64),
        "force": np.array([c.force for c in collisions], np.float64),
        "kind": np.array([KINDS.index(c.kind) for c in collisions], np.uint8),
    }
    topic = Topic("/truth/collisions", "tauguard_msgs/msg/Collision", collision_layout(), values)
    return Group(nanoseconds(onset), [topic])


def alarm_layout() -> Layout:
    """The layout of ``tauguard_msgs/msg/Alarm``."""
    return Layout().header().number("start", "f8").number("end", "f8")


def alarm_group(alarms: tuple[Alarm, ...]) -> Group:
    """Alarms, logged at their starts."""
    start = np.array([alarm.start for alarm in alarms], np.float64)
    end = np.array([alarm.end for alarm in alarms], np.float64)
    values: dict[str, Anything] = stamp(start) | {"start": start, "end": end}
    topic = Topic("/detection/alarms", "tauguard_msgs/msg/Alarm", alarm_layout(), values)
    return Group(nanoseconds(start), [topic])


def decode(contents: Contents) -> Trace:
    """The trace in an MCAP file's records, with its detection."""
    if "tauguard.trace" not in contents.metadata:
        topics = ", ".join(sorted(c.topic for c in contents.channels.values())) or "none"
        raise ValueError(f"no metadata record tauguard.trace (topics: {topics})")
    form = {k: json.loads(v) for k, v in contents.metadata["tauguard.trace"].items()}
    if form["format"] != FORMAT:
        raise ValueError(f"format {form['format']}, this version reads {FORMAT}")
    sampled = layouts(form)
    known = {topic.name: topic.layout for topic in sampled}
    events = {"/truth/collisions": collision_layout(), "/detection/alarms": alarm_layout()}
    tables = collect(contents, known | events | mcap_contacts.layouts(form))
    values: dict[str, Any] = {}
    for topic in sampled:
        table = tables[topic.name]
        if len(table["sec"]) != form["rows"]:
            raise ValueError(
                f"{topic.name}: {len(table['sec'])} messages, expected {form['rows']}: "
                "some were filtered out"
            )
        values |= table
    contents.check_sum()
    truth = None
    if form["truth"]:
        truth = decode_truth(form, values, tables["/truth/collisions"])
    return Trace(
        joint_names=tuple(form["joint_names"]),
        t=values["time"],
        q=values["q"],
        qd=values["qd"],
        current=values["current"],
        **{name: values[name] for name in form["commanded"]},
        truth=truth,
        contacts=mcap_contacts.decode(form, tables),
        meta=contents.metadata.get("tauguard.meta", {}),
        attachments={name: data.decode() for name, data in contents.attachments.items()},
        detection=_detection(form, values, tables["/detection/alarms"]),
    )


def _detection(form: Mapping[str, Any], values: Mapping[str, Any], alarms: Any) -> Detection | None:
    if "detector" not in form:
        return None
    spans = zip(alarms["start"].tolist(), alarms["end"].tolist(), strict=True)
    return Detection(
        detector=form["detector"],
        t=values["time"].copy(),
        residual=values["residual"],
        score=values["score"],
        threshold=float.fromhex(form["threshold"]),
        alarm=values["alarm"],
        alarms=tuple(Alarm(*span) for span in spans),
    )


def decode_truth(form: Mapping[str, Any], values: Mapping[str, Any], table: Any) -> Truth:
    """The truth, from the field arrays of its messages and the ``table`` of collisions."""
    collisions = tuple(
        Collision(
            kind=KINDS[table["kind"][i]],
            onset=float(table["onset"][i]),
            end=float(table["end"][i]),
            link=int(table["link"][i]),
            point=table["point"][i].copy(),
            force=table["force"][i].copy(),
            peak_tau=float(table["peak_tau"][i]),
        )
        for i in range(len(table["onset"]))
    )
    names = tuple(form["obstacle_names"])
    poses = {}
    if names:
        poses = {"obstacle_poses": values["obstacle_poses"].reshape(form["rows"], len(names), 4, 4)}
    fields = "tau_ext", "contact_force", "payload", "contact_link", "contact_point"
    return Truth(
        collisions=collisions,
        obstacle_names=names,
        **{name: values[name] for name in (*fields, "contact_vector")},
        **poses,
    )


def collect(contents: Contents, known: Mapping[str, Layout]) -> dict[str, dict[str, Anything]]:
    """Field arrays of every known topic, sorted by sequence number.

    Raises:
        ValueError: a message whose length or strings differ from the layout of its topic.
    """
    runs: dict[str, list[dict[str, Anything]]] = {name: [] for name in known}
    for channel, sequence, payload in contents.messages():
        name = contents.channels[channel].topic
        if name not in known:
            continue
        layout = known[name]
        if payload.shape[1] != layout.size:
            raise ValueError(f"{name}: a message of {payload.shape[1]} bytes, not {layout.size}")
        try:
            runs[name].append({"sequence": sequence, **layout.unpack(payload)})
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from error
    tables = {}
    for name, layout in known.items():
        empty = np.zeros((0, layout.size), np.uint8) + layout.template()
        parts = runs[name] or [{"sequence": np.empty(0, np.uint32), **layout.unpack(empty)}]
        table = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
        order = np.argsort(table.pop("sequence"), kind="stable")
        if not np.array_equal(order, np.arange(len(order))):
            table = {key: value[order] for key, value in table.items()}
        tables[name] = table
    return tables
