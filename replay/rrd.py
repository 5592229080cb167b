"""Write a trace as a rerun recording (``.rrd``)."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.findings import ArgumentError
from tauguard.replay.estimates import arrow, arrows, during
from tauguard.replay.plot import SCORE_TOP
from tauguard.replay.robot import Body, Motion, bodies, load_model, motion
from tauguard.replay.story import cut, first_moment, page
from tauguard.traces.trace import Detection, Trace

if TYPE_CHECKING:
    from tauguard.detectors import Diagnosis

TIMELINE = "time"
FRAME_RATE = 60.0  # [Hz] rate of body poses
SERIES_RATE = 200.0  # [Hz] rate of charts
MOST_FRAMES = 30_000  # a long recording is thinned to this, so that the file stays below 30 MB
MOST_POINTS = 60_000
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
    robot: Any = None,
    *,
    whole: bool = False,
    explained: Sequence[Diagnosis] = (),
    about: str = "",
) -> None:
    """Write a recording that ``rerun FILE`` opens with its own layout.

    A viewer starts at the beginning of a recording, and nothing in the file can change that. So the
    recording begins at the first detection of a collision, if there is one.

    Args:
        path: the ``.rrd`` file; written atomically.
        trace: the trace to show.
        detection: a detector's output for it.
        robot: the scene: ``mujoco.MjModel``, a path of an MJCF or URDF file or MJCF text; by
            default the trace's first attachment that ends in ``.xml``.
        whole: keep the part before the first detection.
        explained: the diagnosis of each alarm; contacts are drawn as blue arrows.
        about: a line above the text with the reason for showing the recording.

    Raises:
        ArgumentError: no model, a model without the trace's joints, an empty trace.
        OSError: the folder cannot be written.
    """
    path = Path(path)
    if len(trace.t) == 0:
        raise ArgumentError("the trace is empty: nothing to show")
    if robot is None:
        attached = [text for name, text in trace.attachments.items() if name.endswith(".xml")]
        if not attached:
            raise ArgumentError("the trace has no attached MJCF: give the robot's model (`robot=`)")
        robot = attached[0]
    scene = load_model(robot)
    with written(path, "tauguard") as recording:
        text = page(trace, detection, explained, about)
        if not whole:
            trace, detection = cut(trace, detection, first_moment(trace, detection))
        shown = bodies(scene)
        frames = thin(trace.t, FRAME_RATE, MOST_FRAMES)
        moved = motion(scene, trace.joint_names, trace.q[frames])
        lay_out(recording, blueprint(trace, detection, *seen(trace, shown, moved)))
        log_scene(recording, trace, frames, shown, moved)
        log_checked(recording, trace, frames)
        log_explained(recording, trace.t[frames], explained)
        log_series(recording, trace, detection)
        log_states(recording, trace, detection)
        recording.log("about", rr.TextDocument(text, media_type="text/markdown"), static=True)


@contextmanager
def written(path: Path, application: str) -> Iterator[Any]:
    """A recording that becomes the file ``path`` if the block ends without an error."""
    with TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as folder:
        draft = Path(folder) / "draft.rrd"
        recording = rr.RecordingStream(application, recording_id=path.stem)
        recording.save(draft)
        yield recording
        recording.flush()
        recording.disconnect()
        os.replace(draft, path)


def lay_out(recording: Any, layout: rrb.Blueprint) -> None:
    """Send the layout before any data, because it tells the viewer not to play at once.

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
    t, truth = trace.t[frames], trace.truth
    names = truth.obstacle_names if truth is not None else ()
    log_shapes(recording, shown)
    for index, body in enumerate(shown):
        if body.shapes and body.name not in names:
            still = not body.moves
            log_pose(
                recording, body.name, t, moved.positions[:, index], moved.quats[:, index], still
            )
    if truth is None:
        return
    if names:
        from scipy.spatial.transform import Rotation
    for number, name in enumerate(names):
        if not any(body.name == name and body.shapes for body in shown):
            ball = rr.Ellipsoids3D(radii=[0.05], colors=[GREY], fill_mode="solid")
            recording.log(f"{entity('scene', name)}/shape_0", ball, static=True)
        poses = truth.obstacle_poses[frames, number]
        turned = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
        log_pose(recording, name, t, poses[:, :3, 3], turned)
    log_contacts(recording, trace, frames)


def log_shapes(recording: Any, shown: Sequence[Body]) -> None:
    """The shapes of all bodies, and the direction of the vertical."""
    recording.log("scene", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    for body in shown:
        for number, piece in enumerate(body.shapes):
            place = f"{entity('scene', body.name)}/shape_{number}"
            recording.log(place, piece, static=True)


def log_pose(
    recording: Any, name: str, t: Array, positions: Array, quats: Array, still: bool = False
) -> None:
    """Log a body's pose at every time, or once if it is ``still`` or its pose does not change."""
    place = entity("scene", name)
    if still or not (np.ptp(positions, axis=0).any() or np.ptp(quats, axis=0).any()):
        pose = rr.Transform3D(translation=positions[0], quaternion=quats[0])
        recording.log(place, pose, static=True)
        return
    columns = rr.Transform3D.columns(translation=positions, quaternion=quats)
    rr.send_columns(place, times(t), columns, recording=recording)


def log_marks(
    recording: Any,
    place: str,
    t: Array,
    counts: NDArray[np.int64],
    style: Any,
    **values: Any,
) -> None:
    """Log marks, such as points and arrows: ``counts[k]`` of them are shown at time ``t[k]``.

    Args:
        recording: the recording.
        place: the entity's path.
        t: times [s], shape (T,).
        counts: number of marks at each time, shape (T,).
        style: a rerun archetype whose fields are the same for all marks.
        values: the other fields of this archetype, one row per mark.
    """
    recording.log(place, style, static=True)
    parted = [column.partition(counts) for column in type(style).columns(**values)]
    rr.send_columns(place, times(t), parted, recording=recording)


def log_lines(
    recording: Any,
    place: str,
    t: Array,
    values: Array,
    names: list[str],
    colours: Any,
    width: float,
) -> None:
    """Log a chart with one line for each column of ``values``, shape (T, lines)."""
    lines = rr.SeriesLines(names=names, colors=colours, widths=[width] * len(names))
    recording.log(place, lines, static=True)
    columns = rr.Scalars.columns(scalars=values)
    rr.send_columns(place, times(t), columns, recording=recording)


def log_contacts(recording: Any, trace: Trace, starts: NDArray[np.int64]) -> None:
    """Show the strongest contact of the bin at every frame, as a point and an arrow."""
    truth = trace.truth
    assert truth is not None
    size = np.linalg.norm(truth.contact_vector, axis=1)
    ends = np.append(starts[1:], len(trace.t))
    rows = np.array([a + np.argmax(size[a:b]) for a, b in zip(starts, ends, strict=True)])
    there = (size[rows] > 0) & np.isfinite(truth.contact_point[rows]).all(axis=1)
    points, vectors = truth.contact_point[rows][there], arrow(truth.contact_vector[rows][there])
    labels = [f"{value:.0f} N" for value in size[rows][there]]
    t, counts = trace.t[starts], there.astype(int)
    style = rr.Arrows3D.from_fields(radii=0.012, colors=RED, show_labels=True)
    force = {"vectors": vectors, "origins": points - vectors, "labels": labels}
    log_marks(recording, "scene/contact_force", t, counts, style, **force)
    style = rr.Points3D.from_fields(radii=0.02, colors=RED)
    log_marks(recording, "scene/contact_point", t, counts, style, positions=points)


def log_checked(recording: Any, trace: Trace, frames: NDArray[np.int64]) -> None:
    """Show what each contact checker reported as dots with a normal, for the length of a frame."""
    t = trace.t[frames]
    for number, contacts in enumerate(trace.contacts):
        place = f"scene/{entity('checked', contacts.checker)}"
        colour = COLOURS[number % len(COLOURS)]
        known = np.isfinite(contacts.point).all(axis=1)
        frame = np.searchsorted(t, contacts.t[known], side="right") - 1
        counts = np.bincount(np.maximum(frame, 0), minlength=len(t))
        points, normals = contacts.point[known], np.nan_to_num(contacts.normal[known])
        names = [" - ".join(contacts.partners[i] for i in pair) for pair in contacts.pair[known]]
        dot = rr.Points3D.from_fields(radii=0.01, colors=colour, show_labels=False)
        log_marks(recording, f"{place}/point", t, counts, dot, positions=points, labels=names)
        line = rr.Arrows3D.from_fields(radii=0.003, colors=colour)
        arrows = {"vectors": NORMAL * normals, "origins": points}
        log_marks(recording, f"{place}/normal", t, counts, line, **arrows)


def log_explained(recording: Any, t: Array, explained: Sequence[Diagnosis]) -> None:
    """Show the estimated contacts as arrows at the frames' times ``t``, from the alarm on."""
    if explained:
        style = rr.Arrows3D.from_fields(radii=0.012, colors=BLUE, show_labels=True)
        values = arrows(during(explained, t))
        counts = values.pop("lengths")
        log_marks(recording, "scene/estimated_force", t, counts, style, **values)


def log_series(recording: Any, trace: Trace, detection: Detection | None) -> None:
    """Log the charts: currents, velocities, residuals, score and threshold, force."""
    starts = thin(trace.t, SERIES_RATE, MOST_POINTS)

    def series(place: str, values: Array, names: list[str], colours: Any, width: float) -> None:
        shown = extremes(values, starts).reshape(len(starts), -1)
        log_lines(recording, place, trace.t[starts], shown, names, colours, width)

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
