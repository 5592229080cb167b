"""Sample points on the outer surface of an arm's links."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array, in_a_line
from tauguard.findings import FileError
from tauguard.models.arm_file import read_arm
from tauguard.models.nominal import compiled

#: Number of points on each link, and of lines to try per point (lines often miss thin links).
POINTS, TRIES = 150, 40


@dataclass(frozen=True, eq=False)
class LinkSurface:
    """Points spread evenly over the collision geometry of the moving links.

    Link i moves with joint i; its frame has the origin on the joint and the body's axes, which is
    Pinocchio's joint frame.
    """

    __repr__ = in_a_line

    link: NDArray[np.int64]  #: 0-based, increasing, shape (K,)
    point: Array  #: in the link's frame [m], shape (K, 3)
    normal: Array  #: unit vector out of the link, in its frame, shape (K, 3)

    def __post_init__(self) -> None:
        """Check shapes: ``FileError`` names the field."""
        count = len(self.link)
        for name in ("point", "normal"):
            value = getattr(self, name)
            if value.shape != (count, 3) or not np.isfinite(value).all():
                raise FileError(f"{name}: shape {value.shape}, expected ({count}, 3) numbers")
        if count and (self.link.min() < 0 or (np.diff(self.link) < 0).any()):
            raise FileError("link: expected 0-based numbers in rising order")

    def only(self, links: Iterable[int]) -> LinkSurface:
        """The surface of the given links only (1-based).

        Raises:
            FileError: a link has no surface in this object.
        """
        wanted = sorted(set(links))
        there = sorted({int(i) + 1 for i in self.link})
        if not wanted or not set(wanted) <= set(there):
            raise FileError(f"links {wanted}: expected some of {there}")
        rows = np.isin(self.link + 1, wanted)
        return LinkSurface(self.link[rows], self.point[rows], self.normal[rows])


def link_surface(
    source: str | Path | mujoco.MjSpec | mujoco.MjModel, points: int = POINTS, seed: int = 0
) -> LinkSurface:
    """Sample the surface of every moving link of an arm.

    Straight lines with uniformly distributed direction and offset meet a convex surface with equal
    density everywhere (Crofton). So the points where such lines enter a link are spread evenly over
    the surface that can be touched from outside. No line enters where one geom lies inside another.

    Args:
        source: MJCF or URDF (text or file), a spec or a compiled model, of the arm only.
        points: number of points on each link.
        seed: seed of the lines.

    Raises:
        FileError: no model, or no collision geometry (``contype`` or ``conaffinity``) on any
            moving link, as in a URDF without shapes.
    """
    if points < 1:
        raise FileError(f"points {points}: expected 1 or more")
    model = compiled(source)
    data = mujoco.MjData(model)
    data.qpos[:] = 0
    mujoco.mj_kinematics(model, data)
    rng = np.random.default_rng(seed)
    links, places, normals = [], [], []
    for joint in range(model.njnt):
        geoms = _touchable(model, int(model.jnt_bodyid[joint]))
        if not len(geoms):
            continue
        place, out = _entries(model, data, geoms, points, rng)
        body = int(model.jnt_bodyid[joint])
        frame = data.xmat[body].reshape(3, 3)
        places.append((place - data.xpos[body]) @ frame - model.jnt_pos[joint])
        normals.append(out @ frame)
        links.append(np.full(len(place), joint, dtype=np.int64))
    if not links:
        raise FileError(
            "robot: no link has collision geometry, or its meshes were not found; give a model "
            "with its shapes"
        )
    return LinkSurface(np.concatenate(links), np.concatenate(places), np.concatenate(normals))


def arm_surface(
    path: Path, joints: tuple[str, ...], points: int = POINTS
) -> tuple[LinkSurface, tuple[str, ...]]:
    """The surface of the arm in a robot file, and the links that have a substitute capsule.

    Meshes of a URDF are searched for in its folder and the folders above. A link without a shape
    that MuJoCo can read gets a capsule. The last link cannot: its end is unknown.

    Args:
        path: MJCF or URDF file.
        joints: names of the arm's joints; every other joint is welded at zero.
        points: number of points on each link.

    Raises:
        FileError: MuJoCo cannot read the robot, a joint is missing, the joints are no serial
            chain, or the last link has no shape.
    """
    file = read_arm(path, joints)
    if file.joints != joints:
        raise FileError(
            f"{path}: its joints, base to tip, are {', '.join(file.joints)}; expected "
            f"{', '.join(joints)}"
        )
    if file.links[-1] in file.sticks:
        raise FileError(
            f"{path}: the last link, {file.links[-1]}, has no shape, or its mesh is not there"
        )
    return link_surface(file.spec, points), file.sticks


def _touchable(model: mujoco.MjModel, body: int) -> NDArray[np.intp]:
    """Collision geoms that move with ``body``, welded bodies included."""
    own = model.body_weldid[model.geom_bodyid] == body
    solid = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    return np.flatnonzero(own & solid)


def _entries(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    geoms: NDArray[np.intp],
    wanted: int,
    rng: np.random.Generator,
) -> tuple[Array, Array]:
    """Points at which random lines enter the geoms, and outward normals, in the world frame."""
    before = model.geom_group.copy()
    model.geom_group[:] = 0
    model.geom_group[geoms] = 1
    only = np.array([0, 1, 0, 0, 0, 0], dtype=np.uint8)
    centres, radii = data.geom_xpos[geoms], model.geom_rbound[geoms]
    low, high = (centres - radii[:, None]).min(axis=0), (centres + radii[:, None]).max(axis=0)
    centre, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    places: list[Array] = []
    outs: list[Array] = []
    directions = _directions(rng, TRIES * wanted)
    for number, direction in enumerate(directions):
        if len(places) == wanted:
            break
        if number % wanted == 0:
            bases = np.linalg.svd(directions[number : number + wanted, None])[2]
        across = bases[number % wanted, 1:]
        offset = radius * np.sqrt(rng.random()) * np.exp(2j * np.pi * rng.random())
        start = centre - 2 * radius * direction + np.array([offset.real, offset.imag]) @ across
        geom, normal = np.full(1, -1, dtype=np.int32), np.zeros(3)
        along = mujoco.mj_ray(model, data, start, direction, only, 1, -1, geom, normal)
        if along >= 0:
            places.append(start + along * direction)
            outs.append(normal / np.linalg.norm(normal))
    model.geom_group[:] = before
    return np.array(places).reshape(-1, 3), np.array(outs).reshape(-1, 3)


def _directions(rng: np.random.Generator, count: int) -> Array:
    directions = rng.normal(size=(count, 3))
    unit: Array = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return unit
