"""Render a simulated recording to frames, and write frames to a file."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.extras import extra
from tauguard.findings import ArgumentError
from tauguard.replay.estimates import arrow
from tauguard.traces import TARGETS, Trace

#: File extensions that Pillow writes (Matplotlib installs it).
PILLOW = (".gif", ".webp", ".png")
#: View of the camera: azimuth and elevation [deg], distance in units of the arm's size.
VIEW = (140.0, -18.0, 2.0)
#: Least distance of the camera from people and arms, in diagonals of their bounding box.
AROUND = 1.6


def video_frames(
    trace: Trace,
    start: float = 0.0,
    seconds: float | None = None,
    rate: float = 20.0,
    size: tuple[int, int] = (480, 640),
    view: tuple[float, float, float] = VIEW,
) -> Iterator[NDArray[np.uint8]]:
    """Pictures of a recording that contains its scene, shape (height, width, 3).

    They show targets as balls, and the strongest contact since the last picture as an arrow.

    Args:
        trace: as returned by :func:`tauguard.traces.read_mcap`.
        start: start of the drawn part [s].
        seconds: length of the drawn part [s]; None: to the end.
        rate: frames per second of the recording.
        size: height and width [px].
        view: the camera's azimuth and elevation [deg], and distance in units of the arm's size.

    Raises:
        ArgumentError: the recording holds no scene, or no samples in that time.
        RuntimeError: no OpenGL; one line that says what to change.
    """
    import mujoco

    from tauguard.models.picture import mark, opengl, point_at

    if "scene.xml" not in trace.attachments:
        raise ArgumentError("the recording holds no scene: only those of a simulation can be drawn")
    end = trace.t[-1] if seconds is None else min(trace.t[-1], start + seconds)
    rows = np.searchsorted(trace.t, np.arange(start, end, 1 / rate))
    if not len(rows) or start < trace.t[0] - 1:
        raise ArgumentError(
            f"no sample from {start:g} s on: it lasts from {trace.t[0]:g} to {trace.t[-1]:g} s"
        )
    model = _stage(trace, int(rows[0]))
    model.vis.global_.offheight, model.vis.global_.offwidth = size
    data = mujoco.MjData(model)
    camera, options = mujoco.MjvCamera(), mujoco.MjvOption()
    options.geomgroup[3:] = 0
    place = _placer(model, data, trace)
    place(int(rows[0]))
    links = [int(model.joint(name).bodyid[0]) for name in trace.joint_names]
    _look(camera, data.xpos[links], _people(model, data), view)
    with opengl():
        renderer = mujoco.Renderer(model, *size)
    try:
        for last, row in zip([rows[0], *rows[:-1]], rows, strict=True):
            place(int(row))
            renderer.update_scene(data, camera, options)
            mark(renderer.scene, _targets(trace, float(trace.t[row])))
            for point, force in _contact(trace, int(last), int(row)):
                point_at(renderer.scene, point, arrow(force))
            yield renderer.render().copy()
    finally:
        renderer.close()


def _stage(trace: Trace, row: int) -> Any:
    """The recording's scene on a floor below everything that it shows."""
    import mujoco

    from tauguard.models.obstacles import FLOOR_HEIGHT
    from tauguard.models.picture import staged
    from tauguard.replay.robot import load_model

    text = trace.attachments["scene.xml"]
    model = load_model(text)  # refuses models that crash MuJoCo
    data = mujoco.MjData(model)
    _placer(model, data, trace)(row)
    plane = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
    shown = np.flatnonzero((model.geom_group < 3) & ~plane)
    up, box = data.geom_xmat.reshape(-1, 3, 3)[shown, 2], model.geom_aabb[shown]
    middle = data.geom_xpos[shown, 2] + (up * box[:, :3]).sum(axis=1)
    low = middle - (np.abs(up) * box[:, 3:]).sum(axis=1)
    roots = {int(model.body_rootid[model.joint(name).bodyid[0]]) for name in trace.joint_names}
    floor = min(FLOOR_HEIGHT, float(low.min(initial=0.0)))
    spec = mujoco.MjSpec.from_string(text)
    return staged(spec, floor, [model.body_pos[root] for root in sorted(roots)])


def _people(model: Any, data: Any) -> Array:
    """Positions of the capsules of people [m], shape (k, 3)."""
    named = [g for g in range(model.ngeom) if model.geom(g).name.startswith("person")]
    return np.array(data.geom_xpos[named])


def _look(camera: Any, links: Array, people: Array, view: tuple[float, float, float]) -> None:
    """Point the camera at the middle of links and people, from far enough to show them all."""
    spread = float(np.linalg.norm(np.ptp(links, axis=0)))
    camera.lookat[:] = links.mean(axis=0)
    camera.azimuth, camera.elevation, distance = view
    camera.distance = distance * max(spread, 0.2)
    if len(people):
        low, high = (end(np.concatenate([links, people]), axis=0) for end in (np.min, np.max))
        camera.lookat[:] = (low + high) / 2
        camera.distance = max(camera.distance, AROUND * float(np.linalg.norm(high - low)))


def _targets(trace: Trace, t: float) -> Any:
    """Positions of the targets at a time [m], shape (arms, 3); empty without targets."""
    rows = json.loads(trace.attachments.get(TARGETS, "[]"))
    return next((places for begin, places in reversed(rows) if begin <= t), np.zeros((0, 3)))


def _contact(trace: Trace, last: int, row: int) -> Iterator[tuple[Array, Array]]:
    """Point [m] and force [N] of the strongest contact after row ``last``, up to ``row``."""
    if trace.truth is None:
        return
    some = slice(min(last + 1, row), row + 1)
    points, forces = trace.truth.contact_point[some], trace.truth.contact_vector[some]
    strongest = int(np.linalg.norm(forces, axis=1).argmax())
    if forces[strongest].any() and np.isfinite(points[strongest]).all():
        yield points[strongest], forces[strongest]


def _placer(model: Any, data: Any, trace: Trace) -> Any:
    """A function that sets arm and obstacles to the poses of a row of the recording."""
    import mujoco

    joints = [int(model.joint(name).qposadr[0]) for name in trace.joint_names]
    names = trace.truth.obstacle_names if trace.truth is not None else ()
    bodies = [model.body(name) for name in names]

    shapes = [np.flatnonzero(model.geom_bodyid == body.id).tolist() for body in bodies]

    def place(row: int) -> None:
        data.qpos[joints] = trace.q[row]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_camlight(model, data)
        for k, geoms in enumerate(shapes):
            assert trace.truth is not None
            pose, turn = trace.truth.obstacle_poses[row, k], np.zeros(9)
            for geom in geoms:
                mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
                data.geom_xpos[geom] = pose[:3, 3] + pose[:3, :3] @ model.geom_pos[geom]
                data.geom_xmat[geom] = (pose[:3, :3] @ turn.reshape(3, 3)).ravel()

    return place


def write_video(path: Path, pictures: Iterable[NDArray[np.uint8]], rate: float) -> int:
    """Write pictures of shape (height, width, 3), ``rate`` per second; returns their number.

    Raises:
        ArgumentError: an ending that is not known, or MP4 without the extra ``video``.
    """
    ending = path.suffix.lower()
    if ending in PILLOW:
        from PIL import Image

        shown = [Image.fromarray(picture) for picture in pictures]
        shown[0].save(path, save_all=True, append_images=shown[1:], duration=1000 / rate, loop=0)
        return len(shown)
    if ending != ".mp4":
        raise ArgumentError(f"{path}: expected an ending of {', '.join(PILLOW)} or .mp4")
    try:
        from moviepy import ImageSequenceClip
    except ModuleNotFoundError:
        raise ArgumentError(f"{path}: MP4 needs {extra('video')}; .gif does not") from None
    shown = list(pictures)
    ImageSequenceClip(shown, fps=rate).write_videofile(str(path), audio=False, logger=None)
    return len(shown)
