"""How deep a contact will be at the end of a step: the two bodies' own motion along its normal."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tauguard.contacts._contacts import travel
from tauguard.contacts.checker import Contacts, State, geom_kinds

Array = NDArray[np.float64]


class Approach:
    """Material points of geoms and flexes, and how deep they may sink before sides are confused.

    Args:
        model: the scene's.
    """

    def __init__(self, model: Any) -> None:
        """Note each geom's inner radius and which elements meet at each flex vertex."""
        self._body = model.geom_bodyid
        self._travel = travel(
            model.geom_bodyid,
            _inner_radii(model),
            model.flex_vertadr,
            model.flex_vertadr + model.flex_vertnum,
            model.flex_radius,
        )
        self._sheets = [_Sheet(model, flex) for flex in range(model.nflex)]

    def bound(self, contacts: Contacts, before: State, after: State) -> tuple[Array, Array]:
        """How far the partners can approach each other in the whole step, and their core.

        Returns:
            The way and the core, both of shape (K,) [m]. The core is the depth at which the middles
            of both partners meet and a contact's normal turns over.
        """
        way, core = self._travel.bound(
            contacts.geom,
            contacts.flex,
            contacts.point,
            before.xpos,
            before.xmat,
            after.xpos,
            after.xmat,
            before.flexvert_xpos,
            after.flexvert_xpos,
        )
        return way, core

    def oriented(
        self, contacts: Contacts, before: State, after: State
    ) -> tuple[Contacts, NDArray[np.bool_]]:
        """The contacts with a normal each, and in which rows their checker told none. (K,).

        Surfaces that meet from the start, or in a point, have no normal of their own. There the
        direction in which both material points approach each other stands for it: along no other
        one do they come closer. It is zero where nothing moves.
        """
        unknown = ~(np.abs(np.linalg.norm(contacts.normal, axis=1) - 1) < 0.5)
        if not unknown.any():
            return contacts, unknown
        rows = contacts.where(unknown)
        way = self._way(rows, rows.time, before, after)
        length = np.linalg.norm(way, axis=1, keepdims=True)
        normal = contacts.normal.copy()
        normal[unknown] = np.divide(way, length, out=np.zeros_like(way), where=length > 0)
        return replace(contacts, normal=normal), unknown

    def depth(self, contacts: Contacts, before: State, after: State) -> Array:
        """Depth of each contact at the end of the step, had nothing resisted. Shape (K,), m.

        The distance at its time less the way that both material points make towards each other
        along the normal from then on.
        """
        if not len(contacts):
            return np.zeros(0)
        return self._towards(contacts, contacts.time, before, after) - contacts.distance

    def speed(self, contacts: Contacts, before: State, after: State) -> Array:
        """How far both points of each row approach each other over the whole step. (K,), m."""
        towards = self._towards(contacts, np.zeros(len(contacts)), before, after)
        return np.maximum(towards, -contacts.distance)

    def _towards(self, contacts: Contacts, s: Array, before: State, after: State) -> Array:
        """How far both points of each row approach along its normal from ``s`` (K,) to the end."""
        return np.asarray((self._way(contacts, s, before, after) * contacts.normal).sum(axis=1))

    def _way(self, contacts: Contacts, s: Array, before: State, after: State) -> Array:
        """The first partner's way from ``s`` (K,) to the end less the second one's. (K, 3)."""
        ways = []
        for side in (0, 1):
            geom, flex = contacts.geom[:, side], contacts.flex[:, side]
            way = np.zeros((len(contacts), 3))
            rigid = geom >= 0
            way[rigid] = self._rigid_way(
                geom[rigid], contacts.point[rigid], s[rigid], before, after
            )
            for number in set(flex[~rigid].tolist()):
                rows = flex == number
                way[rows] = self._flex_way(number, contacts.point[rows], s[rows], before, after)
            ways.append(way)
        return np.asarray(ways[0] - ways[1])

    def _rigid_way(
        self, geom: NDArray[np.int32], point: Array, s: Array, before: State, after: State
    ) -> Array:
        """The way from time ``s`` to 1 of what is at ``point`` then and moves with ``geom``."""
        body = self._body[geom]
        start, end = before.xmat[body].reshape(-1, 3, 3), after.xmat[body].reshape(-1, 3, 3)
        shift = after.xpos[body] - before.xpos[body]
        arm = point - before.xpos[body] - s[:, None] * shift
        if (start == end).all():
            return np.asarray((1 - s)[:, None] * shift)
        turn = Rotation.from_matrix(end @ start.transpose(0, 2, 1)).as_rotvec()
        rest = Rotation.from_rotvec((1 - s)[:, None] * turn)
        return np.asarray((1 - s)[:, None] * shift + rest.apply(arm) - arm)

    def _flex_way(self, flex: int, point: Array, s: Array, before: State, after: State) -> Array:
        """The same for the point of the flex that is nearest to ``point``."""
        sheet = self._sheets[flex]
        start = before.flexvert_xpos[sheet.vertices]
        travel = after.flexvert_xpos[sheet.vertices] - start
        rows = np.arange(len(point))
        now = start + s[:, None, None] * travel
        nearest = ((now - point[:, None]) ** 2).sum(axis=2).argmin(axis=1)
        around = sheet.elements[sheet.around[nearest]]  # (K, at most so many, corners)
        corners = now[rows[:, None, None], around]
        weights = _weights(corners, point)
        apart = (weights[..., None] * corners).sum(axis=2) - point[:, None]
        best = (apart**2).sum(axis=2).argmin(axis=1)
        way = travel[around[rows, best]] * weights[rows, best][..., None]
        return np.asarray((1 - s)[:, None] * way.sum(axis=1))


class _Sheet:
    """One flex: its vertices, its elements, and the elements around each vertex."""

    def __init__(self, model: Any, flex: int) -> None:
        begin, count = int(model.flex_elemdataadr[flex]), int(model.flex_elemnum[flex])
        corners = int(model.flex_dim[flex]) + 1
        first, number = int(model.flex_vertadr[flex]), int(model.flex_vertnum[flex])
        self.vertices = np.arange(first, first + number)
        self.elements = model.flex_elem[begin : begin + corners * count].reshape(-1, corners)
        lists: list[list[int]] = [[] for _ in range(number)]
        for element, ends in enumerate(self.elements.tolist()):
            for vertex in ends:
                lists[vertex].append(element)
        most = max(len(one) for one in lists)
        # Rows are filled up by repeating; a vertex without elements gets those of vertex 0.
        self.around = np.array([(one or lists[0]) * most for one in lists], dtype=object)
        self.around = np.array([row[:most] for row in self.around], dtype=np.int64)


def _weights(corners: Array, point: Array) -> Array:
    """Weights (K, M, n) of corners (K, M, n, 3) that come near points (K, 3): clamped, sum 1."""
    edges = corners[:, :, 1:] - corners[:, :, :1]
    square = edges @ edges.swapaxes(2, 3)
    least = 1e-12 * np.trace(square, axis1=2, axis2=3) + np.finfo(float).tiny  # corners may agree
    square += least[..., None, None] * np.eye(edges.shape[2])
    side = edges @ (point[:, None] - corners[:, :, 0])[..., None]
    inner = np.linalg.solve(square, side)[..., 0]
    weights = np.concatenate([1 - inner.sum(axis=2, keepdims=True), inner], axis=2)
    weights = np.maximum(weights, 0.0)
    return np.asarray(weights / weights.sum(axis=2, keepdims=True))


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
