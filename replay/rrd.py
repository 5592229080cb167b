"""Write a trace as a rerun recording (``.rrd``). Only this module and :mod:`.live` import rerun."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.replay.estimates import Explained, arrow, arrows, during
from tauguard.replay.robot import Body, Motion, Shape, bodies, load_model, motion, quats_wxyz
from tauguard.replay.story import cut, first_moment, page
from tauguard.traces.trace import Detection, Trace

TIMELINE = "time"
FRAME_RATE = 60.0  # [Hz] rate of body poses
SERIES_RATE = 200.0  # [Hz] rate of charts
MOST_FRAMES = 30_000  # a long recording is thinned to this, so that the file stays below 30 MB
MOST_POINTS = 60_000
SCORE_TOP = 8.0  # upper end of the score's chart in thresholds, so that both are visible
NORMAL = 0.06  # [m], length of a checked contact's normal
COLOURS = np.array(
    [
        [66, 135, 245],
        [245, 166, 35],
        [80, 190, 120],
        [200, 90, 220],
        [120, 200, 220],
        [190, 190, 110],
        [240, 130, 150],
    ],
    np.uint8,
)
RED, GREEN, GREY = (230, 60, 50), (70, 190, 90), (140, 140, 150)
BLUE = (66, 135, 245)


def write_rrd(
    path: str | Path,
    trace: Trace,
    detection: Detection | None = None,
    model: Any = None,
    *,
    whole: bool = False,
    explained: Sequence[Explained] = (),
    about: str = "",
) -> None:
    """Write a recording that ``rerun FILE`` opens with its own layout.

    A viewer starts at the beginning of a recording, and nothing in the file can change that. So the
    recording begins at the first detection of a collision, if there is one.

    Args:
        path: the ``.rrd`` file; written atomically.
        trace: the trace to show.
        detection: a detector's output for it.
        model: the scene: ``mujoco.MjModel``, a path of an MJCF or URDF file or MJCF text; by
            default the trace's first attachment that ends in ``.xml``.
        whole: keep the part before the first detection.
        explained: the diagnosis of each alarm; contacts are drawn as blue arrows.
        about: a line above the text with the reason for showing the recording.

    Raises:
        ValueError: no model, a model without the trace's joints, an empty trace.
        OSError: the folder cannot be written.
    """
    path = Path(path)
    if len(trace.t) == 0:
        raise ValueError("the trace is empty: nothing to show")
    if model is None:
        attached = [text for name, text in trace.attachments.items() if name.endswith(".xml")]
        if not attached:
            raise ValueError("the trace has no attached MJCF: give the robot's model (--robot)")
        model = attached[0]
    scene = load_model(model)
    with TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as folder:
        draft = Path(folder) / "draft.rrd"
        recording = rr.RecordingStream("tauguard", recording_id=path.stem)
        recording.save(draft)
        text = page(trace, detection, explained, about)
        if not whole:
            trace, detection = cut(trace, detection, first_moment(trace, detection))
        shown = bodies(scene)
        frames = thin(trace.t, FRAME_RATE, MOST_FRAMES)
        moved = motion(scene, trace.joint_names, trace.q[frames])
        lay_out(recording, blueprint(trace, detection, *seen(trace, shown, moved)))
        log_scene(recording, trace, frames, shown, moved)
        log_checked(recording, trace)
        log_explained(recording, trace, explained)
        log_series(recording, trace, detection)
        log_states(recording, trace, detection)
        page_text = rr.TextDocument(text, media_type="text/markdown")
        recording.log("about", page_text, static=True)
        recording.flush()
        recording.disconnect()
        os.replace(draft, path)


def lay_out(recording: Any, layout: rrb.Blueprint) -> None:
    """Send the layout before any data: it tells the viewer not to play at once.

    Without the flush a busy machine may write data first.
    """
    recording.send_blueprint(layout)
    recording.flush()


def thin(t: Array, rate: float, most: int) -> NDArray[np.int64]:
    """First rows of bins of 1/``rate`` s; bins are longer if there would be more than ``most``."""
    span = max(t[-1] - t[0], 1e-9)
    rate = min(rate, most / span)
    bins = np.floor((t - t[0]) * rate + 1e-6).astype(np.int64)
    return np.flatnonzero(np.diff(bins, prepend=-1))


def extremes(values: Array, starts: NDArray[np.int64]) -> Array:
    """The value of largest magnitude of each bin, so that no peak is lost; shape (bins, ...)."""
    high = np.maximum.reduceat(values, starts, axis=0)
    low = np.minimum.reduceat(values, starts, axis=0)
    return np.where(np.abs(low) > np.abs(high), low, high)


def times(t: Array) -> list[Any]:
    """The recording's only timeline: times of the trace [s]."""
    return [rr.TimeColumn(TIMELINE, duration=t)]


def entity(*parts: str) -> str:
    """An entity path whose parts may contain any character."""
    return "/".join(rr.escape_entity_path_part(part) for part in parts)


def seen(trace: Trace, shown: Sequence[Body], moved: Motion) -> tuple[Array, float]:
    """Centre [m] and radius [m] of the moving bodies, without obstacles."""
    names = trace.truth.obstacle_names if trace.truth is not None else ()
    arm = [i for i, body in enumerate(shown) if body.moves and body.name not in names] or [0]
    corners = moved.positions[:, arm].reshape(-1, 3)
    center = (corners.min(axis=0) + corners.max(axis=0)) / 2
    return center, float(np.linalg.norm(corners - center, axis=1).max()) + 0.1


def log_scene(
    recording: Any, trace: Trace, frames: NDArray[np.int64], shown: Sequence[Body], moved: Motion
) -> None:
    """The bodies, obstacles and contacts at these rows of the trace."""
    recording.log("scene", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    t, truth = trace.t[frames], trace.truth
    names = truth.obstacle_names if truth is not None else ()
    for index, body in enumerate(shown):
        place = entity("scene", body.name)
        for number, piece in enumerate(body.shapes):
            recording.log(f"{place}/shape_{number}", drawn(piece), static=True)
        if body.shapes and body.name not in names:
            log_pose(recording, place, body, index, t, moved)
    if truth is None:
        return
    for number, name in enumerate(names):
        place = entity("scene", name)
        if not any(body.name == name and body.shapes for body in shown):
            ball = rr.Ellipsoids3D(radii=[0.05], colors=[GREY], fill_mode="solid")
            recording.log(f"{place}/shape_0", ball, static=True)
        poses = truth.obstacle_poses[frames, number]
        columns = rr.Transform3D.columns(
            translation=poses[:, :3, 3],
            quaternion=np.roll(quats_wxyz(poses[:, :3, :3]), -1, axis=1),
        )
        rr.send_columns(place, times(t), columns, recording=recording)
    log_contacts(recording, trace, frames)


def log_pose(recording: Any, place: str, body: Body, index: int, t: Array, moved: Motion) -> None:
    """Log a body's pose: once if it is fixed, otherwise at every frame."""
    positions, quats = moved.positions[:, index], np.roll(moved.quats_wxyz[:, index], -1, axis=1)
    if not body.moves or (np.ptp(positions, axis=0) + np.ptp(quats, axis=0)[:3] == 0).all():
        pose = rr.Transform3D(translation=positions[0], quaternion=quats[0])
        recording.log(place, pose, static=True)
        return
    columns = rr.Transform3D.columns(translation=positions, quaternion=quats)
    rr.send_columns(place, times(t), columns, recording=recording)


def drawn(piece: Shape) -> Any:
    """Convert a shape to a rerun archetype."""
    quat = [np.roll(piece.quat_wxyz, -1)]
    colour = [np.round(255 * np.clip(piece.rgba, 0, 1)).astype(np.uint8)]
    common = {"quaternions": quat, "colors": colour, "fill_mode": "solid"}
    radius, half = float(piece.size[0]), float(piece.size[1])
    if piece.kind == "mesh":
        assert piece.vertices is not None
        assert piece.normals is not None
        rotation = matrix(piece.quat_wxyz)
        return rr.Mesh3D(
            vertex_positions=piece.vertices @ rotation.T + piece.position,
            vertex_normals=piece.normals @ rotation.T,
            triangle_indices=piece.triangles,
            albedo_factor=colour[0],
        )
    if piece.kind == "capsule":  # rerun's capsule begins at its origin and extends along z
        start = piece.position - matrix(piece.quat_wxyz) @ np.array([0.0, 0.0, half])
        return rr.Capsules3D(lengths=[2 * half], radii=[radius], translations=[start], **common)
    centres = [piece.position]
    if piece.kind == "cylinder":
        return rr.Cylinders3D(lengths=[2 * half], radii=[radius], centers=centres, **common)
    if piece.kind == "box":
        return rr.Boxes3D(half_sizes=[piece.size], centers=centres, **common)
    sizes = [radius] * 3 if piece.kind == "sphere" else piece.size
    return rr.Ellipsoids3D(half_sizes=[sizes], centers=centres, **common)


def matrix(quat_wxyz: Array) -> Array:
    """Rotation matrix of a unit quaternion, shape (3, 3)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_quat(quat_wxyz, scalar_first=True).as_matrix(), np.float64)


def log_contacts(recording: Any, trace: Trace, starts: NDArray[np.int64]) -> None:
    """Show the strongest contact of the bin at every frame, as a point and an arrow."""
    truth = trace.truth
    assert truth is not None
    size = np.linalg.norm(truth.contact_vector, axis=1)
    ends = np.append(starts[1:], len(trace.t))
    rows = np.array([a + np.argmax(size[a:b]) for a, b in zip(starts, ends, strict=True)])
    there = (size[rows] > 0) & np.isfinite(truth.contact_point[rows]).all(axis=1)
    points, forces = truth.contact_point[rows][there], truth.contact_vector[rows][there]
    vectors = arrow(forces)
    labels = [f"{value:.0f} N" for value in size[rows][there]]
    when, lengths = times(trace.t[starts]), there.astype(int)
    columns = [
        *rr.Arrows3D.columns(vectors=vectors, origins=points - vectors, labels=labels),
    ]
    styles = rr.Arrows3D.from_fields(radii=0.012, colors=RED, show_labels=True)
    recording.log("scene/contact_force", styles, static=True)
    parted = [column.partition(lengths) for column in columns]
    rr.send_columns("scene/contact_force", when, parted, recording=recording)
    recording.log(
        "scene/contact_point", rr.Points3D.from_fields(radii=0.02, colors=RED), static=True
    )
    parted = [c.partition(lengths) for c in rr.Points3D.columns(positions=points)]
    rr.send_columns("scene/contact_point", when, parted, recording=recording)


def log_checked(recording: Any, trace: Trace) -> None:
    """Show what each contact checker reported as dots with a normal, for the length of a frame."""
    frames = trace.t[thin(trace.t, FRAME_RATE, MOST_FRAMES)]
    for number, contacts in enumerate(trace.contacts):
        place = f"scene/{entity('checked', contacts.checker)}"
        colour = COLOURS[number % len(COLOURS)]
        known = np.isfinite(contacts.point).all(axis=1)
        frame = np.searchsorted(frames, contacts.t[known], side="right") - 1
        lengths = np.bincount(np.maximum(frame, 0), minlength=len(frames))
        points, normals = contacts.point[known], np.nan_to_num(contacts.normal[known])
        names = [" - ".join(contacts.partners[i] for i in pair) for pair in contacts.pair[known]]
        dots = rr.Points3D.columns(positions=points, labels=names)
        arrows = rr.Arrows3D.columns(vectors=NORMAL * normals, origins=points)
        for part, columns, style in (
            ("point", dots, rr.Points3D.from_fields(radii=0.01, colors=colour, show_labels=False)),
            ("normal", arrows, rr.Arrows3D.from_fields(radii=0.003, colors=colour)),
        ):
            recording.log(f"{place}/{part}", style, static=True)
            parted = [column.partition(lengths) for column in columns]
            rr.send_columns(f"{place}/{part}", times(frames), parted, recording=recording)


def log_explained(recording: Any, trace: Trace, explained: Sequence[Explained]) -> None:
    """Show the estimated contacts as arrows, from the alarm on."""
    if not explained:
        return
    frames = trace.t[thin(trace.t, FRAME_RATE, MOST_FRAMES)]
    drawn_arrows = arrows(during(explained, frames))
    lengths = drawn_arrows.pop("lengths")
    place = "scene/estimated_force"
    styles = rr.Arrows3D.from_fields(radii=0.012, colors=BLUE, show_labels=True)
    recording.log(place, styles, static=True)
    parted = [column.partition(lengths) for column in rr.Arrows3D.columns(**drawn_arrows)]
    rr.send_columns(place, times(frames), parted, recording=recording)


def log_series(recording: Any, trace: Trace, detection: Detection | None) -> None:
    """Log the charts: currents, velocities, residuals, score and threshold, force."""
    starts = thin(trace.t, SERIES_RATE, MOST_POINTS)
    when = times(trace.t[starts])

    def series(place: str, values: Array, names: list[str], colours: Any, width: float) -> None:
        lines = rr.SeriesLines(names=names, colors=colours, widths=[width] * len(names))
        recording.log(place, lines, static=True)
        values = extremes(values, starts).reshape(len(starts), -1)
        rr.send_columns(place, when, rr.Scalars.columns(scalars=values), recording=recording)

    names = list(trace.joint_names)
    colours = [COLOURS[i % len(COLOURS)] for i in range(len(names))]
    series("current", trace.current, names, colours, 1.0)
    series("velocity", trace.qd, names, colours, 1.0)
    if detection is not None:
        series("residual", detection.residual, names, colours, 1.2)
        series("score/score", detection.score, [detection.detector], [COLOURS[0]], 1.5)
        edge = np.full(len(trace.t), detection.threshold)
        series("score/threshold", edge, ["threshold"], [RED], 1.0)
    if trace.truth is not None:
        series("force", trace.truth.contact_force, ["contact force"], [RED], 1.5)


def log_states(recording: Any, trace: Trace, detection: Detection | None) -> None:
    """Log two lanes: true contacts and alarms."""
    if trace.truth is not None:
        spans = [(c.onset, c.end, c.kind) for c in trace.truth.collisions]
        log_lane(recording, "states/truth", "free", spans, trace.t)
    if detection is not None:
        spans = [(a.start, a.end, "alarm") for a in detection.alarms]
        log_lane(recording, "states/alarm", "quiet", spans, trace.t)


def log_lane(
    recording: Any, place: str, rest: str, spans: list[tuple[float, float, str]], t: Array
) -> None:
    """Log one lane of a state timeline: ``rest`` is the state between the spans."""
    first = float(t[0])
    changes = {first: rest}
    for start, end, name in sorted(spans):
        changes[max(start, first)] = name
        changes[max(end, start + 1e-3)] = rest
    when, what = np.array(sorted(changes)), [changes[key] for key in sorted(changes)]
    columns = rr.StateChange.columns(state=what)
    values = [rest, *sorted({name for _, _, name in spans})]
    colours = [GREY if v == rest else GREEN if place.endswith("truth") else RED for v in values]
    recording.log(place, rr.StateConfiguration(values=values, colors=colours), static=True)
    rr.send_columns(place, times(when), columns, recording=recording)


def blueprint(trace: Trace, detection: Detection | None, center: Array, radius: float) -> Any:
    """The layout: 3D on the left with the text below it, charts on the right."""
    eye = rrb.EyeControls3D(
        position=center + 2.4 * radius * np.array([0.62, -0.68, 0.4]),
        look_target=center,
        eye_up=(0, 0, 1),
    )
    left = rrb.Vertical(
        rrb.Spatial3DView(origin="scene", name="The arm", eye_controls=eye),
        rrb.TextDocumentView(origin="about", name="What you see"),
        row_shares=[2, 1],
    )
    around = rr.VisibleTimeRange(
        TIMELINE,
        start=rr.TimeRangeBoundary.cursor_relative(seconds=-1.0),
        end=rr.TimeRangeBoundary.cursor_relative(seconds=2.0),
    )

    def chart(origin: str, name: str, *values: Array) -> Any:
        low = min(float(np.min(value)) for value in values)
        high = max(float(np.max(value)) for value in values)
        margin = 0.05 * (high - low) or 1.0
        return rrb.TimeSeriesView(
            origin=origin,
            name=name,
            time_ranges=around,
            axis_y=rrb.ScalarAxis(range=(low - margin, high + margin), zoom_lock=True),
            plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop),
        )

    charts = []
    if detection is not None:
        edge = np.array(detection.threshold)
        top = SCORE_TOP * detection.threshold if detection.threshold > 0 else np.inf
        charts += [
            chart("residual", "Residual [N m]", detection.residual),
            chart("score", "Score of the detector", np.minimum(detection.score, top), edge),
        ]
    if detection is not None or trace.truth is not None:
        charts.append(rrb.StateTimelineView(origin="states", name="Alarm and truth"))
    if trace.truth is not None:
        charts.append(chart("force", "Contact force, truth [N]", trace.truth.contact_force))
    charts.append(chart("current", "Motor current [A]", trace.current))
    charts.append(chart("velocity", "Joint velocity [rad/s]", trace.qd))
    return rrb.Blueprint(
        rrb.Horizontal(left, rrb.Vertical(*charts), column_shares=[1, 1]),
        rrb.TimePanel(
            state="collapsed", timeline=TIMELINE, play_state="paused", playback_speed=0.5
        ),
        collapse_panels=True,
    )
