"""Pairs of a mesh surface with a mesh or a box, tested by :mod:`tauguard.rigid`."""

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from tauguard.arrays import Array
from tauguard.contacts.checker import Contacts, State, geom_kinds
from tauguard.contacts.geoms import mesh_surface
from tauguard.rigid import MeshTree, Motion, time_of_impact

_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
_QUADS = np.array(
    [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
)
_SIDES = np.concatenate([_QUADS[:, [0, 1, 2]], _QUADS[:, [0, 2, 3]]])


class SurfacePairs:
    """Times of impact of the surfaces of meshes and boxes.

    Args:
        model: MjModel.
        pairs: Rows of two geoms, meshes or boxes. Shape (P, 2).
    """

    def __init__(self, model: Any, pairs: Sequence[tuple[int, int]]) -> None:
        """Build one tree per geom, in the frame of its body."""
        self._pairs = list(pairs)
        self._body = model.geom_bodyid
        kinds = geom_kinds(model)
        self._trees = {}
        for geom in sorted({g for pair in pairs for g in pair}):
            if kinds[geom] == "box":
                points, faces = _CORNERS * model.geom_size[geom], _SIDES
            else:
                points, faces = mesh_surface(model, geom)
            mat = np.zeros(9)
            mujoco.mju_quat2Mat(mat, model.geom_quat[geom])
            self._trees[geom] = MeshTree(points @ mat.reshape(3, 3).T + model.geom_pos[geom], faces)
        self._reach = {
            geom: float(np.linalg.norm(tree.vertices, axis=1).max())
            for geom, tree in self._trees.items()
        }

    def check(self, before: State, after: State) -> Contacts:
        """The first contact of each pair; the depth is 0 if surfaces intersect at the start."""
        motions: dict[int, Motion] = {}
        rows = []
        for a, b in self._pairs:
            one, other = (motions.setdefault(k, self._motion(k, before, after)) for k in (a, b))
            if self._apart(a, b, one, other):
                continue
            impact = time_of_impact(self._trees[a], self._trees[b], one, other)
            if impact.hit[0]:
                rows.append((a, b, impact))
        return Contacts(
            time=np.array([impact.time_of_impact[0] for *_, impact in rows]),
            geom=np.array([(a, b) for a, b, _ in rows], dtype=np.int32).reshape(-1, 2),
            flex=np.full((len(rows), 2), -1, dtype=np.int32),
            feature=np.array([i.faces[0] for *_, i in rows], dtype=np.int32).reshape(-1, 2),
            point=np.array([impact.point[0] for *_, impact in rows]).reshape(-1, 3),
            normal=np.array([impact.normal[0] for *_, impact in rows]).reshape(-1, 3),
            distance=np.zeros(len(rows)),
        )

    def _motion(self, geom: int, before: State, after: State) -> Motion:
        from scipy.spatial.transform import Rotation

        body = int(self._body[geom])
        start, end = (s.xmat[body].reshape(3, 3) for s in (before, after))
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = start, before.xpos[body]
        turn = np.zeros(3)
        if (start != end).any():
            turn = Rotation.from_matrix(end @ start.T).as_rotvec()
        return Motion(pose, after.xpos[body] - before.xpos[body], turn)

    def _apart(self, a: int, b: int, one: Motion, other: Motion) -> bool:
        """Whether balls around the origins of both bodies stay apart on the whole path."""
        start: Array = other.pose_t0[0, :3, 3] - one.pose_t0[0, :3, 3]
        drift: Array = other.linear[0] - one.linear[0]
        along = float(np.clip(-(start @ drift) / max(float(drift @ drift), 1e-300), 0, 1))
        nearest = float(np.linalg.norm(start + along * drift))
        return nearest > (self._reach[a] + self._reach[b]) * (1 + 1e-9)
