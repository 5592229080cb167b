"""The positions of geoms and flex vertices within a step, on the path of the checkers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array
from tauguard.contacts.checker import State


@dataclass(frozen=True)
class Step:
    """The motion of all geoms and flex vertices of a scene in one step.

    A point y of a body moves as ``xpos + s dx + exp(s [w]x) xmat y``, s in [0, 1]. Flex vertices
    move linearly.
    """

    origin: Array  #: origin of each geom's body at s = 0, shape (ngeom, 3) [m]
    shift: Array  #: dx, shape (ngeom, 3) [m]
    turn: Array  #: w in the world frame, shape (ngeom, 3) [rad]
    arm: Array  #: vector from the body's origin to the geom's centre at s = 0, shape (ngeom, 3) [m]
    xmat: Array  #: the geom's rotation at s = 0, shape (ngeom, 3, 3)
    vertices: Array  #: flex vertices at s = 0, shape (V, 3) [m]
    travel: Array  #: displacement of flex vertices, shape (V, 3) [m]

    @classmethod
    def between(cls, model: Any, before: State, after: State) -> Step:
        """The step from ``before`` to ``after``."""
        from scipy.spatial.transform import Rotation

        body = model.geom_bodyid
        start = before.xmat.reshape(-1, 3, 3)
        between = after.xmat.reshape(-1, 3, 3) @ start.transpose(0, 2, 1)
        turn = Rotation.from_matrix(between).as_rotvec()
        same = (before.xmat == after.xmat).all(axis=1)
        turn[same] = 0.0
        return cls(
            origin=before.xpos[body],
            shift=(after.xpos - before.xpos)[body],
            turn=turn[body],
            arm=before.geom_xpos - before.xpos[body],
            xmat=before.geom_xmat.reshape(-1, 3, 3),
            vertices=before.flexvert_xpos,
            travel=after.flexvert_xpos - before.flexvert_xpos,
        )

    def poses(self, geoms: NDArray[Any], s: Array) -> tuple[Array, Array]:
        """Centres (K, 3) and rotations (K, 3, 3) of ``geoms`` (K,) at ``s`` (K,)."""
        from scipy.spatial.transform import Rotation

        turn = Rotation.from_rotvec(s[:, None] * self.turn[geoms])
        center = self.origin[geoms] + s[:, None] * self.shift[geoms] + turn.apply(self.arm[geoms])
        return center, turn.as_matrix() @ self.xmat[geoms]

    def reach(self, geoms: NDArray[Any], radius: Array) -> Array:
        """Bound on how far rotation moves points within ``radius`` (K,) of a geom's centre [m]."""
        spin = np.linalg.norm(self.turn[geoms], axis=1)
        return np.asarray(spin * (np.linalg.norm(self.arm[geoms], axis=1) + radius))
