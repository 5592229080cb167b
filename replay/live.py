"""Show a running simulation in the rerun viewer, or write it to a file while it runs."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import ArrayLike, NDArray

from tauguard.replay.estimates import arrow
from tauguard.replay.robot import bodies, sheets
from tauguard.replay.rrd import COLOURS, GREEN, RED, TIMELINE, entity, log_shapes

HOST = "127.0.0.1"  # the only address that the viewer listens on
PATIENCE = 20.0  # longest wait for the viewer [s]
#: Message if the viewer was closed, or began to listen and then found no display.
GONE = 'the rerun viewer ended; without a display use `save="FILE.rrd"`'
#: Radius of a target's mark [m].
MARK = 0.03
#: Grey-blue of a cloth.
CLOTH = (90, 130, 190)


class LiveView:
    """Sends a scene, and then its states one by one, to a viewer or a file."""

    def __init__(self, model: Any, save: Path | None = None, port: int = 9876) -> None:
        """Open the viewer on 127.0.0.1, or the file.

        Args:
            model: ``mujoco.MjModel`` of the scene.
            save: a ``.rrd`` file instead of a viewer.
            port: port of the viewer.

        Raises:
            OSError: the viewer did not come up, or the file cannot be written.
        """
        self._model, self._bodies = model, bodies(model)
        self._recording = rr.RecordingStream("tauguard_watch")
        self._viewer: subprocess.Popen[bytes] | None = None
        self._port = port
        if save is not None:
            self._recording.save(save)
        else:
            self._viewer = open_viewer(port)
            self._recording.connect_grpc(f"rerun+http://{HOST}:{port}/proxy")
        log_shapes(self._recording, self._bodies)
        self._named: set[str] = set()

    def layout(self, charts: Mapping[str, str]) -> None:
        """The layout: 3D on the left, the charts (origin: title) on the right."""
        views = [rrb.TimeSeriesView(origin=origin, name=name) for origin, name in charts.items()]
        scene = rrb.Spatial3DView(origin="scene", name="The scene")
        self._recording.send_blueprint(
            rrb.Blueprint(
                rrb.Horizontal(scene, rrb.Vertical(*views), column_shares=[3, 2]),
                rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="following"),
                collapse_panels=True,
            )
        )

    def show(self, data: Any, seconds: float, targets: ArrayLike) -> None:
        """Show the state at ``seconds``, with a ball at each target, shape (k, 3) [m].

        Raises:
            OSError: the viewer is gone.
        """
        if self._viewer is not None and self._viewer.poll() is not None:
            if not listens(self._port):
                raise OSError(GONE)
            self._viewer = None  # an earlier viewer listens there
        self._recording.set_time(TIMELINE, duration=seconds)
        for index, body in enumerate(self._bodies):
            if body.shapes and (body.moves or seconds == 0):
                pose = rr.Transform3D(
                    translation=data.xpos[index], quaternion=np.roll(data.xquat[index], -1)
                )
                self._recording.log(entity("scene", body.name), pose)
        marks = np.asarray(targets, dtype=float).reshape(-1, 3)
        balls = rr.Points3D(marks, radii=MARK, colors=[GREEN] * len(marks))
        self._recording.log("scene/targets", balls)
        for flex, rows, triangles in sheets(self._model):
            places = data.flexvert_xpos[rows].astype(np.float32)
            sheet = rr.Mesh3D(
                vertex_positions=places, triangle_indices=triangles, albedo_factor=CLOTH
            )
            self._recording.log(f"scene/cloth_{flex}", sheet)

    def contact(self, point: NDArray[np.float64], force: NDArray[np.float64]) -> None:
        """Show an arrow at ``point`` [m] along ``force`` [N]; a zero force removes it."""
        if not force.any():
            self._recording.log("scene/contact", rr.Clear(recursive=False))
            return
        vector = arrow(force)
        self._recording.log(
            "scene/contact", rr.Arrows3D(origins=[point - vector], vectors=[vector], colors=[RED])
        )

    def chart(self, origin: str, names: list[str], values: ArrayLike) -> None:
        """Add a sample to a chart, which has a line for each name."""
        if origin not in self._named:
            colours = [COLOURS[i % len(COLOURS)] for i in range(len(names))]
            lines = rr.SeriesLines(names=names, colors=colours)
            self._recording.log(origin, lines, static=True)
            self._named.add(origin)
        self._recording.log(origin, rr.Scalars(np.asarray(values, dtype=float).ravel()))

    def close(self) -> None:
        """Send the remaining data; the viewer stays open.

        Raises:
            OSError: the viewer is gone.
        """
        try:
            self._recording.flush()
            self._recording.disconnect()
        except RuntimeError as error:
            raise OSError(GONE) from error


def listens(port: int) -> bool:
    """Whether something on this machine listens on the port."""
    with socket.socket() as probe:
        probe.settimeout(0.2)
        return probe.connect_ex((HOST, port)) == 0


def open_viewer(port: int) -> subprocess.Popen[bytes]:
    """The rerun viewer, listening on 127.0.0.1 only.

    Raises:
        OSError: it cannot be started, ended, or did not listen in time.
    """
    program = Path(sys.executable).with_name("rerun")
    viewer = subprocess.Popen([program, "--bind", HOST, "--port", str(port)])
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        if viewer.poll() is not None:
            break
        if listens(port):
            return viewer
        time.sleep(0.1)
    raise OSError(
        f"the rerun viewer did not come up on {HOST}:{port}; without a display use "
        '`save="FILE.rrd"`'
    )
