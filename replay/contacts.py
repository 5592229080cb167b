"""Write a run of a MuJoCo scene with the contacts that checkers reported as a rerun recording."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.findings import ArgumentError
from tauguard.replay.robot import bodies, sheets
from tauguard.replay.rrd import (
    COLOURS,
    TIMELINE,
    entity,
    lay_out,
    log_lines,
    log_marks,
    log_pose,
    log_shapes,
    written,
)

#: Contacts of one checker: their times [s], shape (K,), points [m] and normals, shape (K, 3).
Marks = tuple[Array, Array, Array]
POINT = 6e-3  # [m] radius of a drawn contact
NORMAL = 0.06  # [m] half length of the arrow along the normal, visible outside the bodies
CLOTH = (170, 120, 90)


def write_contacts_rrd(
    path: str | Path,
    *,
    model: Any,
    t: Array,
    positions: Array,
    rotations: Array,
    vertices: Array | None = None,
    marks: Mapping[str, Marks] | None = None,
    notes: Sequence[tuple[float, str]] = (),
) -> None:
    """Write a recording that ``rerun FILE`` opens: bodies, cloth, contacts, and notes in time.

    Args:
        path: The ``.rrd`` file; written atomically.
        model: ``mujoco.MjModel``.
        t: Increasing times [s]. Shape (T,).
        positions: Positions of the bodies. Shape (T, nbody, 3), m.
        rotations: Rotation matrices of the bodies. Shape (T, nbody, 3, 3).
        vertices: Vertices of the flexes. Shape (T, nflexvert, 3), m.
        marks: The contacts of each checker, by name.
        notes: Times [s] and texts, such as disagreements.

    Raises:
        ArgumentError: an empty run, or arrays that do not fit the model.
        OSError: the folder cannot be written.
    """
    from scipy.spatial.transform import Rotation

    path = Path(path)
    shapes = {
        "positions": (positions, (len(t), model.nbody, 3)),
        "rotations": (rotations, (len(t), model.nbody, 3, 3)),
    }
    if model.nflexvert:
        given = np.zeros(0) if vertices is None else vertices
        shapes["vertices"] = (given, (len(t), model.nflexvert, 3))
    for name, (value, shape) in shapes.items():
        if np.shape(value) != shape:
            raise ArgumentError(f"{name}: shape {np.shape(value)}, expected {shape}")
    if len(t) == 0:
        raise ArgumentError("t: empty, nothing to show")
    with written(path, "tauguard_contacts") as recording:
        lay_out(recording, _blueprint(_eye(marks or {}, positions, vertices)))
        shown = bodies(model)
        log_shapes(recording, shown)
        quats = Rotation.from_matrix(rotations.reshape(-1, 3, 3)).as_quat().reshape(len(t), -1, 4)
        for k, body in enumerate(shown):
            if body.shapes:
                still = not body.moves
                log_pose(recording, body.name, t, positions[:, k], quats[:, k], still)
        if vertices is not None:
            _log_cloth(recording, model, t, vertices)
        for number, (name, seen) in enumerate((marks or {}).items()):
            _log_marks(recording, name, COLOURS[number % len(COLOURS)], t, seen)
        for moment, text in notes or [(float(t[0]), "no disagreements")]:
            recording.set_time(TIMELINE, duration=moment)
            recording.log("notes", rr.TextLog(text))


def _eye(
    marks: Mapping[str, Marks], positions: Array, vertices: Array | None
) -> rrb.EyeControls3D | None:
    """A viewing direction across the mean contact normal, which shows both partners."""
    known = [np.isfinite(seen[1]).all(axis=1) for seen in marks.values()]
    points = [seen[1][rows] for seen, rows in zip(marks.values(), known, strict=True)]
    normals = [seen[2][rows] for seen, rows in zip(marks.values(), known, strict=True)]
    if not sum(map(len, points)):
        return None
    target = np.median(np.concatenate(points), axis=0)
    normal = np.nan_to_num(np.concatenate(normals)).mean(axis=0)
    across = np.array([normal[1], -normal[0], 0.0])
    if np.linalg.norm(across) < 0.1:  # vertical normal: any direction will do
        across = np.array([1.0, 0.0, 0.0])
    moving = positions[:, 1:] if vertices is None else vertices
    spread = moving.max(axis=(0, 1)) - moving.min(axis=(0, 1)) if moving.size else np.ones(3)
    away = across / np.linalg.norm(across) + [0.0, 0.0, 0.35]
    eye = target + (0.2 + float(np.linalg.norm(spread))) * away
    return rrb.EyeControls3D(position=tuple(eye), look_target=tuple(target), eye_up=(0, 0, 1))


def _blueprint(eye: rrb.EyeControls3D | None) -> rrb.Blueprint:
    """The layout: scene, number of contacts by checker, and disagreements."""
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Spatial3DView(origin="/", name="scene", eye_controls=eye),
            rrb.Vertical(
                rrb.TimeSeriesView(
                    origin="seen",
                    name="contacts seen in a step, by checker (colours as in the scene)",
                ),
                rrb.TextLogView(origin="notes", name="disagreements with the ground truth"),
            ),
            column_shares=[3, 2],
        ),
        rrb.TimePanel(
            state="collapsed", timeline=TIMELINE, play_state="paused", playback_speed=0.1
        ),
        collapse_panels=True,
    )


def _log_cloth(recording: Any, model: Any, t: Array, vertices: Array) -> None:
    for flex, rows, faces in sheets(model):
        for row, when in enumerate(t):
            recording.set_time(TIMELINE, duration=float(when))
            mesh = rr.Mesh3D(
                vertex_positions=vertices[row, rows], triangle_indices=faces, albedo_factor=CLOTH
            )
            recording.log(entity("scene", f"flex {flex}"), mesh)


def _log_marks(
    recording: Any, name: str, colour: NDArray[np.uint8], t: Array, marks: Marks
) -> None:
    """Show the contacts of each interval between two states at the interval's end."""
    when, points, normals = marks
    row = np.searchsorted(t, when)
    known = np.flatnonzero((row < len(t)) & np.isfinite(points).all(axis=1))
    order = known[np.argsort(row[known], kind="stable")]
    counts = np.bincount(row[order], minlength=len(t))
    seen = counts.astype(np.float64)[:, None]
    log_lines(recording, entity("seen", name), t, seen, [name], [colour], 2)
    points, normals = points[order], np.nan_to_num(normals[order])
    place = entity("contacts", name)
    dot = rr.Points3D.from_fields(radii=POINT, colors=[colour])
    log_marks(recording, f"{place}/point", t, counts, dot, positions=points)
    line = rr.Arrows3D.from_fields(radii=0.2 * POINT, colors=[colour])
    arrows = {"origins": points - NORMAL * normals, "vectors": 2 * NORMAL * normals}
    log_marks(recording, f"{place}/normal", t, counts, line, **arrows)
