"""A scene with a mesh that falls onto the table."""

from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.contacts.scenes.scene import ContactScene
from tauguard.models import Table
from tauguard.models.obstacles import add_table
from tauguard.models.scene import INTEGRATORS
from tauguard.untrusted_input import reading

SIZE = 0.15  #: longest side of the mesh's bounding box [m]
HEIGHT = 0.05  #: the lowest point of the mesh starts at HEIGHT + SIZE / 4 above the table [m]


def bunny_table(mesh: str | Path | None = None, speed: float = 1.0) -> ContactScene:
    """A mesh falls onto the table, tumbling; MuJoCo collides its convex hull.

    Args:
        mesh: A file that trimesh can read, for example the Stanford bunny; scaled to 15 cm.
            ``None``: a lumpy ball of 1,280 triangles.
        speed: Initial speed, downwards [m/s].

    Raises:
        FileNotFoundError: the file does not exist.
        ValueError: not a triangle mesh, or vertices that are not finite.
    """
    points, faces = _lumpy_ball() if mesh is None else _load(Path(mesh))
    points = (
        (points - (points.max(axis=0) + points.min(axis=0)) / 2) * SIZE / np.ptp(points, 0).max()
    )
    spec = mujoco.MjSpec()
    spec.option.integrator = INTEGRATORS["implicitfast"]
    table = Table(position=(0.0, 0.0, 0.0))
    add_table(spec, table)
    spec.add_mesh(name="thing", uservert=points.ravel(), userface=faces.ravel())
    body = spec.worldbody.add_body(name="thing")
    body.add_freejoint()
    body.add_geom(
        name="thing",
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname="thing",
        mass=0.4,
        contype=1,
        conaffinity=2,
    )
    model = spec.compile()
    qpos, qvel = model.qpos0.copy(), np.zeros(model.nv)
    below = float(model.geom_aabb[-1, 5] - model.geom_aabb[-1, 2])
    qpos[2] = table.half_extents[2] + HEIGHT + below + SIZE / 4
    qvel[:] = [0.1, 0.05, -speed, 3.0, 2.0, 1.0]
    return ContactScene("bunny_table", model, qpos, qvel, 0.5)


def _load(path: Path) -> tuple[Array, NDArray[np.int32]]:
    import trimesh

    if not path.is_file():
        raise FileNotFoundError(f"mesh {path}: no such file")
    with reading(path, "expected a triangle mesh"):
        loaded = trimesh.load_mesh(path)
        points, faces = np.asarray(loaded.vertices, float), np.asarray(loaded.faces, np.int32)
        if len(faces) == 0 or not np.isfinite(points).all():
            raise ValueError("no triangles, or vertices that are not finite")
    return points, faces


def _lumpy_ball() -> tuple[Array, NDArray[np.int32]]:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=3)
    points = np.asarray(ball.vertices, dtype=np.float64)
    waves = np.sin(3 * points[:, 0] + 1) + np.sin(4 * points[:, 1]) * np.cos(3 * points[:, 2])
    return points * (1 + 0.12 * waves[:, None]), np.asarray(ball.faces, dtype=np.int32)
