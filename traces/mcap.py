"""Write a trace as an MCAP file of ROS 2 messages, and read it back with equal bits.

Topics: those of :data:`SAMPLES` with one message per sample, those of :data:`EVENTS`, and
``/contacts/CHECKER``. The metadata record ``tauguard.meta`` contains :attr:`Trace.meta`;
:attr:`Trace.attachments` are MCAP attachments. Log times are the times of the trace. Equal traces
give equal bytes: the file does not depend on when or where it was written.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tauguard.arrays import Array
from tauguard.atomic_write import atomic_file
from tauguard.findings import FileError
from tauguard.traces.contacts import CheckedContacts
from tauguard.traces.mcap_cdr import Anything, Layout, nanoseconds, stamp
from tauguard.traces.mcap_container import Contents, Group, Topic
from tauguard.traces.mcap_schemas import layout
from tauguard.traces.mcap_writer import Writer
from tauguard.traces.trace import COMMANDED, KINDS, Alarm, Collision, Detection, Trace, Truth
from tauguard.untrusted_input import reading

FORMAT = "1"
LIBRARY = f"tauguard traces {FORMAT}"
MEDIA_TYPES = {".xml": "text/xml", ".json": "application/json", ".toml": "application/toml"}
#: Fields of the truth with a row per sample, apart from the poses of obstacles.
TRUTH = "tau_ext", "contact_force", "payload", "contact_link", "contact_point", "contact_vector"
#: Topics with one message per sample: type, and fields of trace, truth or detection.
SAMPLES: dict[str, tuple[str, tuple[str, ...]]] = {
    "/joint_states": ("sensor_msgs/msg/JointState", ("q", "qd", "effort")),
    "/motor_currents": ("tauguard_msgs/msg/MotorCurrents", ("time", "current")),
    "/joint_command": ("tauguard_msgs/msg/JointCommand", COMMANDED),
    "/truth/contact": ("tauguard_msgs/msg/ContactTruth", TRUTH),
    "/truth/obstacles": ("tauguard_msgs/msg/Obstacles", ("obstacle_poses",)),
    "/detection": (
        "tauguard_msgs/msg/Detection",
        ("time", "residual", "score", "threshold", "alarm"),
    ),
}
#: Topics with one message per event: type, and fields of :class:`Collision` or :class:`Alarm`. The
#: first field is the time of the message.
EVENTS: dict[str, tuple[str, tuple[str, ...]]] = {
    "/truth/collisions": (
        "tauguard_msgs/msg/Collision",
        ("onset", "end", "peak_tau", "link", "point", "force", "kind"),
    ),
    "/detection/alarms": ("tauguard_msgs/msg/Alarm", ("start", "end")),
}
#: The type of checked contacts, and its fields.
CHECKED = (
    "tauguard_msgs/msg/CheckedContact",
    ("time", "first", "second", "point", "normal", "distance"),
)


def write_mcap(path: str | Path, trace: Trace, detection: Detection | None = None) -> None:
    """Write a trace, and a detector's output for it, as one MCAP file.

    ``detection`` defaults to ``trace.detection``. An existing file is replaced atomically: the new
    one is written in the same folder and renamed.

    Raises:
        FileError: a field of the wrong shape, a time below 0 or after the year 2262, or a
            detection whose times are not those of the trace.
        OSError: the folder is missing or cannot be written.
    """
    path = Path(path)
    detection = trace.detection if detection is None else detection
    form = describe(trace, detection)
    groups = [Group(nanoseconds(trace.t), sample_topics(trace, detection, form))]
    if trace.truth is not None:
        groups.append(event_group("/truth/collisions", trace.truth.collisions))
    if detection is not None:
        groups.append(event_group("/detection/alarms", detection.alarms))
    groups += [contact_group(one) for one in trace.contacts]
    with atomic_file(path) as stream:
        writer = Writer(stream, LIBRARY)
        writer.metadata("tauguard.meta", trace.meta)
        texts = {name: json.dumps(value) for name, value in form.items()}
        writer.metadata("tauguard.trace", texts)
        for name, text in sorted(trace.attachments.items()):
            media_type = MEDIA_TYPES.get(Path(name).suffix, "text/plain")
            writer.attachment(name, media_type, text.encode())
        for group in groups:
            if len(group.nanoseconds) or group is groups[0]:
                writer.group(group)
        writer.finish()


def read_mcap(path: str | Path) -> Trace:
    """Read a file of :func:`write_mcap`; all arrays have the bits that were written.

    The detector's output is in ``Trace.detection``. Without obstacles, ``obstacle_poses`` has its
    default shape (0, 0, 4, 4).

    Raises:
        FileError: not a file of :func:`write_mcap`, or truncated, damaged, or with messages
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


def describe(trace: Trace, detection: Detection | None) -> dict[str, Any]:
    """Metadata, stored as JSON, from which the reader derives the layouts of the messages.

    Raises:
        FileError: a checker has two entries.
    """
    form: dict[str, Any] = {
        "format": FORMAT,
        "joint_names": trace.joint_names,
        "commanded": [name for name in COMMANDED if name in trace.signals],
        "truth": trace.truth is not None,
        "obstacle_names": trace.truth.obstacle_names if trace.truth is not None else (),
        "rows": len(trace.t),
    }
    if detection is not None:
        form |= {"detector": detection.detector, "threshold": float(detection.threshold).hex()}
    if trace.contacts:
        names = [one.checker for one in trace.contacts]
        if len(set(names)) < len(names):
            raise FileError(f"contacts: a checker twice: {', '.join(names)}")
        form["checkers"] = [
            {"name": one.checker, "partners": one.partners, "rows": len(one)}
            for one in trace.contacts
        ]
    return form


def sample_layouts(form: Mapping[str, Any]) -> dict[str, Layout]:
    """The layout of each topic with one message per sample, in the order of writing."""
    joints, obstacles = form["joint_names"], form["obstacle_names"]
    wide = "q", "qd", "current", "tau_ext", "residual", *form["commanded"]
    lengths = dict.fromkeys(wide, len(joints)) | {"obstacle_poses": 16 * len(obstacles)}
    strings = {"/joint_states": joints, "/truth/obstacles": obstacles}
    there = {
        "/joint_command": form["commanded"],
        "/truth/contact": form["truth"],
        "/truth/obstacles": obstacles,
        "/detection": "detector" in form,
    }
    return {
        topic: layout(kind, fields, strings.get(topic, ()), lengths)
        for topic, (kind, fields) in SAMPLES.items()
        if there.get(topic, True)
    }


def sample_topics(
    trace: Trace, detection: Detection | None, form: Mapping[str, Any]
) -> list[Topic]:
    """The topics of :func:`sample_layouts` with the trace's and the detection's values.

    Raises:
        FileError: poses of the wrong shape, or the detection of another trace.
    """
    truth = trace.truth
    values: dict[str, Anything] = {**stamp(trace.t), "time": trace.t, **trace.signals}
    if truth is not None:
        values |= {name: getattr(truth, name) for name in TRUTH}
        shape = (len(trace.t), len(truth.obstacle_names), 4, 4)
        if truth.obstacle_names and truth.obstacle_poses.shape != shape:
            raise FileError(
                f"truth.obstacle_poses: shape {truth.obstacle_poses.shape}, expected {shape}"
            )
        poses = truth.obstacle_poses
        values["obstacle_poses"] = poses.reshape(len(poses), 16 * len(truth.obstacle_names))
    if detection is not None:
        if not np.array_equal(detection.t, trace.t):
            raise FileError("detection.t: differs from trace.t; expected one row per sample")
        values |= {name: getattr(detection, name) for name in ("residual", "score", "alarm")}
        values["threshold"] = np.full(len(trace.t), detection.threshold)
    return [
        Topic(topic, SAMPLES[topic][0], found, {name: values[name] for name in found.fields})
        for topic, found in sample_layouts(form).items()
    ]


def event_group(topic: str, events: Sequence[Collision] | Sequence[Alarm]) -> Group:
    """Events of one kind, logged at their beginnings.

    Raises:
        FileError: an unknown kind of collision.
    """
    kind, fields = EVENTS[topic]
    values: dict[str, Any] = {name: [getattr(one, name) for one in events] for name in fields}
    for name in values.get("kind", ()):
        if name not in KINDS:
            raise FileError(f"collision kind {name!r}: one of {', '.join(KINDS)}")
    if "kind" in values:
        values["kind"] = [KINDS.index(name) for name in values["kind"]]
    arrays = {name: np.array(value) for name, value in values.items()}
    return _group(topic, kind, layout(kind, fields), arrays[fields[0]], arrays)


def contact_group(contacts: CheckedContacts) -> Group:
    """The contacts of one checker, logged at their times."""
    values = {name: getattr(contacts, name) for name in ("point", "normal", "distance")}
    values |= {"time": contacts.t, "first": contacts.pair[:, 0], "second": contacts.pair[:, 1]}
    form = layout(*CHECKED, contacts.partners)
    return _group(f"/contacts/{contacts.checker}", CHECKED[0], form, contacts.t, values)


def _group(topic: str, kind: str, form: Layout, t: Array, values: Mapping[str, Anything]) -> Group:
    return Group(nanoseconds(t), [Topic(topic, kind, form, {**stamp(t), **values})])


def decode(contents: Contents) -> Trace:
    """The trace in an MCAP file's records, with its detection."""
    if "tauguard.trace" not in contents.metadata:
        topics = ", ".join(sorted(c.topic for c in contents.channels.values())) or "none"
        raise FileError(f"no metadata record tauguard.trace (topics: {topics})")
    form = {k: json.loads(v) for k, v in contents.metadata["tauguard.trace"].items()}
    if form["format"] != FORMAT:
        raise FileError(f"format {form['format']}, this version reads {FORMAT}")
    sampled = sample_layouts(form)
    checkers = {f"/contacts/{one['name']}": one for one in form.get("checkers", [])}
    checked = {topic: layout(*CHECKED, one["partners"]) for topic, one in checkers.items()}
    events = {topic: layout(*one) for topic, one in EVENTS.items()}
    tables = collect(contents, sampled | events | checked)
    rows = dict.fromkeys(sampled, form["rows"])
    rows |= {topic: one["rows"] for topic, one in checkers.items()}
    for topic, wanted in rows.items():
        if (found := len(tables[topic]["sec"])) != wanted:
            raise FileError(f"{topic}: {found} messages, expected {wanted}: some were filtered out")
    values: dict[str, Any] = {}
    for topic in sampled:
        values |= tables[topic]
    contents.check_sum()
    return Trace(
        joint_names=tuple(form["joint_names"]),
        t=values["time"],
        **{name: values[name] for name in ("q", "qd", "current", *form["commanded"])},
        truth=decode_truth(form, values, tables["/truth/collisions"]) if form["truth"] else None,
        contacts=tuple(
            decode_contacts(one, tables[f"/contacts/{one['name']}"])
            for one in form.get("checkers", [])
        ),
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
        threshold=float.fromhex(form["threshold"]),
        alarms=tuple(Alarm(*span) for span in spans),
        **{name: values[name] for name in ("residual", "score", "alarm")},
    )


def decode_truth(form: Mapping[str, Any], values: Mapping[str, Any], table: Any) -> Truth:
    """The truth, from the field arrays of its messages and the ``table`` of collisions."""
    numbers = {name: table[name].tolist() for name in ("onset", "end", "link", "peak_tau")}
    collisions = tuple(
        Collision(
            kind=KINDS[table["kind"][i]],
            point=table["point"][i].copy(),
            force=table["force"][i].copy(),
            **{name: value[i] for name, value in numbers.items()},
        )
        for i in range(len(table["onset"]))
    )
    names, fields = tuple(form["obstacle_names"]), {name: values[name] for name in TRUTH}
    if names:
        poses = values["obstacle_poses"].reshape(form["rows"], len(names), 4, 4)
        fields["obstacle_poses"] = poses
    return Truth(collisions=collisions, obstacle_names=names, **fields)


def decode_contacts(form: Mapping[str, Any], table: Any) -> CheckedContacts:
    """The contacts of one checker, from the ``table`` of its messages."""
    return CheckedContacts(
        checker=form["name"],
        partners=tuple(form["partners"]),
        t=table["time"],
        pair=np.column_stack([table["first"], table["second"]]),
        **{name: table[name] for name in ("point", "normal", "distance")},
    )


def collect(contents: Contents, known: Mapping[str, Layout]) -> dict[str, dict[str, Anything]]:
    """Field arrays of every known topic, sorted by sequence number.

    Raises:
        FileError: a message whose length or strings differ from the layout of its topic.
    """
    runs: dict[str, list[dict[str, Anything]]] = {name: [] for name in known}
    for channel, sequence, _, payload in contents.messages():
        name = contents.channels[channel].topic
        if name not in known:
            continue
        layout = known[name]
        if payload.shape[1] != layout.size:
            raise FileError(f"{name}: a message of {payload.shape[1]} bytes, not {layout.size}")
        try:
            runs[name].append({"sequence": sequence, **layout.unpack(payload)})
        except ValueError as error:
            raise FileError(f"{name}: {error}") from error
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
