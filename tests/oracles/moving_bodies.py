"""Random bodies in motion, for the tests of bodies with radii and of meshes beside them."""

import numpy as np
from scipy.spatial.transform import Rotation

from oracles.convex_overlap import exact_vertices
from tauguard.rigid import Boxes, Capsules, Hulls, Motion, Rounded, Spheres, Tetrahedra
from tauguard.rigid.rounded import parts

REST = Motion(np.eye(4), np.zeros(3), np.zeros(3))
EYE = np.eye(3)[None]


def as_hulls(points):
    """A batch of hulls from the vertices of each."""
    return Hulls(np.concatenate(points), np.cumsum([0, *map(len, points)]))


def motions(rng, n, reach, speed=2.0):
    pose = np.tile(np.eye(4), (n, 1, 1))
    pose[:, :3, :3] = Rotation.random(n, random_state=rng).as_matrix()
    pose[:, :3, 3] = rng.uniform(-reach, reach, (n, 3))
    return Motion(pose, *rng.uniform(-speed, speed, (2, n, 3)))


def rounded(kind, rng, n):
    """Bodies in their own frames."""
    r = rng.uniform(0.05, 0.4, n)
    if kind == "spheres":
        return Spheres(rng.uniform(-0.3, 0.3, (n, 3)), r)
    if kind == "capsules":
        return Capsules(*rng.uniform(-0.7, 0.7, (2, n, 3)), r)
    if kind == "rounded boxes":
        return Rounded(Boxes(np.zeros((n, 3)), rng.uniform(0, 0.6, (n, 3)), EYE.repeat(n, 0)), r)
    if kind == "tetrahedra":
        return Tetrahedra(rng.uniform(-0.7, 0.7, (n, 4, 3)))
    return Boxes(np.zeros((n, 3)), rng.uniform(0.2, 0.8, (n, 3)), EYE.repeat(n, 0))


def corners_of(solid):
    """The corners of every core, in doubles."""
    core = parts(solid)[0]
    return [
        np.array([[float(x) for x in p] for p in exact_vertices(core, i)[0]])
        for i in range(len(solid))
    ]


def placed(solid, motion, t, corners=None):
    """The batch where its motion has it, as hulls of its cores' corners with radii."""
    pose = motion.at(t)
    points = [
        p @ pose[i, :3, :3].T + pose[i, :3, 3] for i, p in enumerate(corners or corners_of(solid))
    ]
    return Rounded(as_hulls(points), np.broadcast_to(parts(solid)[1], len(solid)))
