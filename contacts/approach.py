"""How deep a contact will be at the end of a step: the two bodies' own motion along its normal."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tauguard.contacts.checker import Contacts, State, geom_kinds

Array = NDArray[np.float64]


class Approach:
    """Material points of geoms and flexes, and how deep they may sink before sides are confused.

    Args:
        model: the scene's.
    """

    def __init__(self, model: Any) -> None:
        """Note each geom's inner radius and which triangles meet at each flex vertex."""
        self._body = model.geom_bodyid
        self._inner = _inner_radii(model)
        self._flex_radius = model.flex_radius
        self._triangles: list[NDArray[np.int32]] = []
        for flex in range(model.nflex):
            begin, count = int(model.flex_elemdataadr[flex]), int(model.flex_elemnum[flex])
            corners = int(model.flex_dim[flex]) + 1
            elements = model.flex_elem[begin : begin + corners * count].reshape(-1, corners)
            self._triangles.append(elements + int(model.flex_vertadr[flex]))

    def core(self, contacts: Contacts) -> Array:
        """Depth at which the middles meet and a contact's normal turns over. Shape (K,), m."""
        return self._radius(contacts, 0) + self._radius(contacts, 1)

    def _radius(self, contacts: Contacts, side: int) -> Array:
        geom, flex = contacts.geom[:, side], contacts.flex[:, side]
        out = np.empty(len(contacts))
        rigid = geom >= 0
        out[rigid] = self._inner[geom[rigid]]
        out[~rigid] = self._flex_radius[flex[~rigid]]
        return out

    def depth(self, contacts: Contacts, before: State, after: State) -> Array:
        """Depth of each contact at the end of the step, had nothing resisted. Shape (K,), m.

        The distance at its time less the way that both material points make towards each other
        along the normal from then on.
        """
        rows = range(len(contacts))
        towards = [self._towards(contacts, k, contacts.time[k], before, after) for k in rows]
        return np.array(towards, dtype=np.float64) - contacts.distance

    def speed(self, contacts: Contacts, k: int, before: State, after: State) -> float:
        """How fast both points of row ``k`` approach each other over the whole step [m/step]."""
        towards = self._towards(contacts, k, 0.0, before, after)
        return max(towards, float(-contacts.distance[k]))

    def bound(self, contacts: Contacts, before: State, after: State) -> Array:
        """How far the partners can approach each other in the whole step. Shape (K,), m."""
        flex = np.zeros(max(len(self._triangles), 1))
        travel = np.linalg.norm(after.flexvert_xpos - before.flexvert_xpos, axis=1)
        for number, triangles in enumerate(self._triangles):
            flex[number] = travel[triangles].max(initial=0.0)
        shift = np.linalg.norm(after.xpos - before.xpos, axis=1)
        start, end = before.xmat.reshape(-1, 3, 3), after.xmat.reshape(-1, 3, 3)
        turn = np.linalg.norm(
            end - start, axis=(1, 2)
        )  # at least the chord that a point at 1 m makes
        out = np.zeros(len(contacts))
        for side in (0, 1):
            geom = contacts.geom[:, side]
            body = self._body[geom]
            lever = np.linalg.norm(contacts.point - before.xpos[body], axis=1)
            rigid = shift[body] + turn[body] * (lever + shift[body])
            out += np.where(geom >= 0, rigid, flex[contacts.flex[:, side]])
        return out

    def _towards(self, contacts: Contacts, k: int, s: float, before: State, after: State) -> float:
        """How far the points of row ``k`` approach along its normal from time ``s`` to the end."""
        point = contacts.point[k]
        ways = [
            self._rigid_way(int(contacts.geom[k, side]), point, float(s), before, after)
            if contacts.geom[k, side] >= 0
            else self._flex_way(int(contacts.flex[k, side]), point, float(s), before, after)
            for side in (0, 1)
        ]
        return float((ways[0] - ways[1]) @ contacts.normal[k])

    def _rigid_way(self, geom: int, point: Array, s: float, before: State, after: State) -> Array:
        """The way from time ``s`` to 1 of what is at ``point`` then and moves with ``geom``."""
        body = self._body[geom]
        start, end = before.xmat[body].reshape(3, 3), after.xmat[body].reshape(3, 3)
        origin = before.xpos[body] + s * (after.xpos[body] - before.xpos[body])
        turn = Rotation.from_matrix(end @ start.T).as_rotvec()
        rest = Rotation.from_rotvec((1 - s) * turn)
        return np.asarray(after.xpos[body] + rest.apply(point - origin) - point)

    def _flex_way(self, flex: int, point: Array, s: float, before: State, after: State) -> Array:
        """The same for the point of the flex that is nearest to ``point``."""
        triangles = self._triangles[flex]
        travel = after.flexvert_xpos - before.flexvert_xpos
        now = before.flexvert_xpos + s * travel
        used = np.unique(triangles)
        nearest = used[np.argmin(np.linalg.norm(now[used] - point, axis=1))]
        around = triangles[(triangles == nearest).any(axis=1)]
        best, way = np.inf, travel[nearest]
        for corners in around:
            weights = _weights(now[corners], point)
            apart = float(np.linalg.norm(weights @ now[corners] - point))
            if apart < best:
                best, way = apart, weights @ travel[corners]
        return np.asarray((1 - s) * way)


def _weights(corners: Array, point: Array) -> Array:
    """Weights of the corners (n, 3) whose mean comes near ``point``: projected, then clamped."""
    edges = (corners[1:] - corners[0]).T
    inner = np.linalg.lstsq(edges, point - corners[0], rcond=None)[0]
    weights = np.maximum(np.array([1 - inner.sum(), *inner]), 0.0)
    return np.asarray(weights / weights.sum())


def _inner_radii(model: Any) -> Array:
    """Half the least thickness of each geom [m]; infinite for planes, 0 where it is not known."""
    size, out = model.geom_size, np.zeros(model.ngeom)
    for geom, kind in enumerate(geom_kinds(model)):
        if kind in ("sphere", "capsule"):
            out[geom] = size[geom, 0]
        elif kind == "cylinder":
            out[geom] = size[geom, :2].min()
        elif kind in ("box", "ellipsoid"):
            out[geom] = size[geom].min()
        elif kind == "plane":
            out[geom] = np.inf
        elif kind == "mesh":
            out[geom] = model.geom_aabb[geom, 3:].min()
    return out
