"""Geoms eroded by a layer of their surface, as shapes of the native kernel."""

from __future__ import annotations

from typing import Any

import numpy as np

from tauguard.arrays import Array
from tauguard.contacts._contacts import Guard
from tauguard.contacts.frames import frame_on_mover
from tauguard.contacts.geoms import NATIVE_KINDS, hull_vertices

_NONE = np.zeros((0, 3))


class ErodedShapes:
    """Eroded shapes of a model's geoms; each is added to the native guard once.

    Args:
        model: MjModel.
        kinds: The kind of each geom.
        guard: The native guard that receives the shapes.
    """

    def __init__(self, model: Any, kinds: list[str], guard: Guard) -> None:
        """Start without shapes."""
        self._model, self._kinds, self._guard = model, kinds, guard
        self._hulls: dict[int, _Hull] = {}
        self._added: dict[tuple[int, float], int] = {}

    def radius(self, geom: int) -> float:
        """Radius of the largest ball inside a geom [m]; 0 for a plane."""
        size, kind = self._model.geom_size[geom], self._kinds[geom]
        if kind in ("sphere", "capsule"):
            return float(size[0])
        if kind == "cylinder":
            return float(size[:2].min())
        if kind in ("box", "ellipsoid"):
            return float(size.min())
        return self._hull(geom).radius if kind == "mesh" else 0.0

    def add(self, geom: int, layer: float) -> int:
        """Erode ``geom`` by ``layer`` < ``radius(geom)`` [m], and return the shape's number."""
        key = (geom, layer)
        if key not in self._added:
            self._added[key] = self._new(geom, layer)
        return self._added[key]

    def _new(self, geom: int, layer: float) -> int:
        model, kind = self._model, self._kinds[geom]
        size, vertices, radius = model.geom_size[geom].astype(np.float64), _NONE, 0.0
        if kind in ("sphere", "capsule"):
            radius = float(size[0]) - layer
        elif kind in ("cylinder", "box", "ellipsoid"):
            size = np.maximum(size - layer, 0)
        elif kind == "mesh":
            vertices = self._hull(geom).core(layer)
        mover, place, mat = frame_on_mover(model, geom)
        return self._guard.add(NATIVE_KINDS[kind], size, radius, mover, place, mat, vertices)

    def _hull(self, geom: int) -> _Hull:
        mesh = int(self._model.geom_dataid[geom])
        if mesh not in self._hulls:
            self._hulls[mesh] = _Hull(hull_vertices(self._model, geom))
        return self._hulls[mesh]


class _Hull:
    """A convex hull and its erosion. The origin is the centre of the mesh."""

    def __init__(self, vertices: Array) -> None:
        from scipy.optimize import linprog
        from scipy.spatial import ConvexHull, QhullError

        self._vertices = np.ascontiguousarray(vertices)
        self._faces, self._middle, self.radius = None, vertices.mean(axis=0), 0.0
        try:
            self._faces = np.unique(ConvexHull(vertices).equations, axis=0)
        except QhullError:
            return  # a flat hull is not eroded
        # The largest ball inside the hull: n.x + r <= -d for every face.
        n, d = self._faces[:, :3], self._faces[:, 3]
        ball = linprog([0, 0, 0, -1], np.c_[n, np.ones(len(n))], -d, bounds=[(None, None)] * 4)
        if ball.success and ball.x[3] > 0:
            self._middle, self.radius = ball.x[:3], float(ball.x[3])

    def core(self, layer: float) -> Array:
        """The vertices of the hull eroded by ``layer`` [m]."""
        from scipy.spatial import HalfspaceIntersection, QhullError

        if layer <= 0 or self._faces is None:
            return self._vertices
        moved = self._faces + np.array([0, 0, 0, layer])
        try:
            corners = HalfspaceIntersection(moved, self._middle).intersections
            corners = corners[np.isfinite(corners).all(axis=1)]
        except QhullError:
            corners = _NONE
        if len(corners) < 4:  # a very thin body is scaled towards its middle instead
            corners = self._middle + (1 - layer / self.radius) * (self._vertices - self._middle)
        # Every eroded shape must contain the centre of the mesh, also if erosion would remove it.
        about_centre = (1 - layer / self.radius) * self._vertices
        return np.ascontiguousarray(np.unique(np.concatenate([corners, about_centre]), axis=0))
