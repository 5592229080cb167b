"""Continuous collision detection of a deforming triangle mesh, with one call per frame.

The broad phase keeps a hierarchy of k-DOPs (Klosowski et al. 1998), which is refitted every frame,
and the front of its bounding-volume traversal tree (Li & Chen 1998; Tang et al. 2010). It differs
from these publications in three points:

* Vertices, edges and faces have separate trees with 16 features per leaf, so that no elementary
  pair is tested twice.
* *Moving* volumes have an interval at each end of the step instead of one that covers the step.
  They give fewer candidates and miss no collision (see ``k_dop.hpp``).
* Features can be added and removed without a rebuild (``update_topology``).
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from numbers import Real
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tauguard.cloth import _mesh
from tauguard.cloth.frame import Frame, FrameStats
from tauguard.cloth.impacts import METHODS, Impacts, checked_distance, method_number
from tauguard.cloth.safe_steps import safe_fraction
from tauguard.cloth.topology import Groups, Isolated, Topology
from tauguard.findings import ArgumentError
from tauguard.geometry import finite, frozen, frozen_indices, thread_count

#: Bounding volumes by name: k, and whether the volume is moving (two intervals per axis, one at
#: each end of the step) or covers the whole step. ``None``: moving in those steps in which
#: vertices move, on average, by more than about a quarter of an edge.
VOLUMES: dict[str, tuple[int, bool | None]] = {
    "auto": (14, None),
    **{f"k_dop{k}": (k, False) for k in (6, 14, 16, 18, 26)},
    **{f"moving_k_dop{k}": (k, True) for k in (6, 14, 16, 18, 26)},
    "aabb": (6, False),
    "moving_aabb": (6, True),
}

#: Default limits of ``find`` and ``candidates``, for each kind of pair.
MOST_COLLISIONS, MOST_CANDIDATES = 4_000_000, 50_000_000

_NO_GROUPS = (np.zeros(0, dtype=np.int32), np.zeros((0, 0), dtype=np.uint8))


class MeshCCD:
    """Every collision of a deforming mesh with itself (or between its parts) in each step.

    Args:
        faces: Shape (F, 3), three different vertices each; may be empty. Vertices that no face,
            edge or point uses are ignored.
        method: Method of the narrow phase, one of :data:`tauguard.cloth.METHODS`.
        threads: 0 means all processors. Results do not depend on it.
        groups: Groups of vertices, and the pairs of groups to test. ``None``: test everything.
        volume: One of :data:`VOLUMES`. All find the same collisions; they differ in cost.
        edges: Edges without a face (rods, wires), shape (L, 2); edges of faces are ignored.
        points: Vertices without face or edge that are also tested (particles), shape (P,).

    Attributes:
        method, threads, volume: As given; ``threads`` 0 is replaced by the number of processors.
        broad_stats: Counts and seconds of the last :meth:`candidates`; empty before.

    A call handles one step, in which every vertex moves linearly. The hierarchy is built in the
    first call and kept. Arguments are copied.

    Calls from several Python threads on one object wait for each other. Ctrl-C ends a call, and the
    object can be used again. A forked process can use its copy of the object; the copy raises a
    ``RuntimeError`` if another thread was in a call at the fork. Attributes cannot be assigned;
    :meth:`update_topology` changes faces and groups.

    Raises:
        ArgumentError: a face repeats a vertex, an index is negative, a face mixes groups,
            ``groups`` is not a :class:`Groups`, ``threads`` is not an integer from 0 to 1024, or
            the method or volume is unknown.
    """

    #: Values of ``method``, with the numbers of the native module.
    methods: ClassVar[Mapping[str, int]] = METHODS

    def __init__(
        self,
        faces: ArrayLike,
        method: str = "ab2pf",
        threads: int = 1,
        groups: Groups | None = None,
        volume: str = "auto",
        edges: ArrayLike = (),
        points: ArrayLike = (),
    ) -> None:
        """Check the faces and number the edges; the first frame builds the hierarchy."""
        self._method_number = method_number(method, self.methods)
        if not isinstance(volume, str) or volume not in VOLUMES:
            raise ArgumentError(f"volume {volume!r}: expected one of {', '.join(VOLUMES)}")
        k, moving = VOLUMES[volume]
        self._method, self._volume, self._threads = method, volume, thread_count(threads)
        faces, isolated = self._checked_parts(faces, edges, points, groups)
        rows = np.concatenate([faces, isolated.rows()])
        self._mesh = _mesh.Mesh(rows, *_group_arrays(groups), k, moving, self._threads)
        self._topology = Topology(faces, isolated, frozen(self._mesh.edges()), groups)
        self.broad_stats: dict[str, Any] = {}

    @property
    def faces(self) -> NDArray[np.int32]:
        """Vertices of each face, read-only; ``Frame.vf`` names a face by its row. Shape (F, 3)."""
        return self._topology.faces

    @property
    def edges(self) -> NDArray[np.int32]:
        """Edges of faces and given edges, without repetition, smaller vertex first, read-only.

        ``Frame.ee`` has row numbers of this array. Shape (E, 2).
        """
        return self._topology.edges

    @property
    def points(self) -> NDArray[np.int32]:
        """The given points that belong to no face or edge. Shape (P,)."""
        return self._topology.isolated.points

    @property
    def groups(self) -> Groups | None:
        """The groups, as given."""
        return self._topology.groups

    @property
    def method(self) -> str:
        """The narrow phase."""
        return self._method

    def __repr__(self) -> str:
        counts = f"{len(self.faces)} faces, {len(self.edges)} edges, {len(self.points)} points"
        return f"{type(self).__name__}({counts}, method={self.method!r})"

    @property
    def threads(self) -> int:
        """The number of threads, at least 1."""
        return self._threads

    @property
    def volume(self) -> str:
        """One of :data:`VOLUMES`."""
        return self._volume

    def find(
        self,
        x_t0: ArrayLike,
        x_t1: ArrayLike,
        min_distance: float = 0.0,
        fresh: bool = False,
        limit: int = MOST_COLLISIONS,
    ) -> Frame:
        """Every collision of one step.

        Args:
            x_t0: Positions at the start of the step [any unit]. Shape (V, 3).
            x_t1: Positions at the end of the step. Shape (V, 3).
            min_distance: Distance that counts as contact, in the unit of the positions. Results are
                exact for 0 and conservative otherwise.
            fresh: Start the traversal at the root instead of the last frame's front. The result is
                the same.
            limit: Largest number of collisions of each kind (some 300 bytes each). The number of
                pairs of tree nodes in the traversal (16 bytes each) is limited to 8 times this
                number.

        Raises:
            ArgumentError: as :meth:`candidates`.
        """
        start, end = self._checked_step(x_t0, x_t1)
        try:
            return self._find(start, end, min_distance, _checked_flag(fresh), _checked_limit(limit))
        except _mesh.TooManyError as error:
            raise ArgumentError(str(error)) from None

    def _find(
        self,
        x_t0: NDArray[np.float64],
        x_t1: NDArray[np.float64],
        min_distance: float,
        fresh: bool,
        limit: int,
    ) -> Frame:
        """``find`` with checked arguments; raises the native module's ``TooManyError``."""
        start = time.perf_counter()
        distance = checked_distance(min_distance, self.method)
        vf, ee, stats = self._mesh.find(x_t0, x_t1, self._method_number, distance, fresh, limit)
        topology = self._topology
        answer = Frame(
            **topology.parts(vf["pairs"], _impacts(vf)),
            ee=ee["pairs"],
            ee_impacts=_impacts(ee),
            stats=FrameStats(
                vf["counts"], ee["counts"], stats["seconds"], stats["builds"], stats["bytes"]
            ),
        )
        answer.stats.seconds["total"] = time.perf_counter() - start
        return answer

    def candidates(
        self,
        x_t0: ArrayLike,
        x_t1: ArrayLike,
        min_distance: float = 0.0,
        fresh: bool = False,
        limit: int = MOST_CANDIDATES,
    ) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Candidates of the broad phase.

        The two features of a candidate have overlapping volumes, no common vertex, and groups that
        are to be tested. Some bounds have 16 bits, so that volumes can also be apart by up to
        1.5e-4 of the mesh's extent.

        Args:
            x_t0: As for :meth:`find`.
            x_t1: As for :meth:`find`.
            min_distance: As for :meth:`find`.
            fresh: As for :meth:`find`.
            limit: Largest number of candidates of each kind (some 30 bytes each).

        Returns:
            Rows (vertex, face), shape (M, 2), and rows of two edges (smaller first), shape (K, 2),
            sorted.

        Raises:
            ArgumentError: positions that are not finite or not of shape (V, 3); a number of
                vertices that differs between the ends of the step, from earlier frames or from
                ``groups``, or that is too small for the faces; a distance that is not a number or
                negative; a ``fresh`` that is not a bool; or more candidates than ``limit``.
        """
        vf, ee, self.broad_stats = self._mesh.candidates(
            *self._checked_step(x_t0, x_t1),
            checked_distance(min_distance, self.method),
            _checked_flag(fresh),
            _checked_limit(limit),
        )
        return vf[vf[:, 1] < len(self.faces)], ee

    def safe_step(
        self,
        x_t0: ArrayLike,
        x_t1: ArrayLike,
        min_distance: float = 0.0,
        fraction: float = 0.9,
        limit: int = MOST_COLLISIONS,
    ) -> float:
        """A fraction ``s`` such that the step scaled by ``s`` has no contact.

        The step from ``x_t0`` to ``x_t0 + s * (x_t1 - x_t0)`` is rounded to doubles and tested;
        ``s`` is reduced until this step has no contact. So rounding cannot add a contact, and the
        next step starts without one. Computing time and memory are in proportion to what happens
        before the first contact.

        Features that touch at the start, or are closer than ``min_distance``, have no contact if
        they move apart: their distance never shrinks, and they are apart at the end.

        Args:
            x_t0: Positions at the start of the step [any unit]. Shape (V, 3).
            x_t1: Positions at the end of the step. Shape (V, 3).
            min_distance: Smallest distance allowed, in the unit of the positions.
            fraction: Part of the time until the first contact that is used, above 0 and below 1.
            limit: As in :meth:`find`, for the part of the step before the first contact.

        Returns:
            1.0 if the whole step has no contact. 0.0 if there is contact at its start, of features
            that do not move apart, or if no positive fraction is found.

        Raises:
            ArgumentError: as :meth:`find`, or a ``fraction`` outside (0, 1).
        """
        if not (isinstance(fraction, Real) and 0 < fraction < 1):
            raise ArgumentError(
                f"fraction: {fraction!r:.40}, expected a number above 0 and below 1"
            )
        start, end = self._checked_step(x_t0, x_t1)
        most = _checked_limit(limit)
        try:
            return safe_fraction(
                lambda reach, few: self._find(start, reach, min_distance, False, few),
                self._vertices_of,
                start,
                end,
                self.edges,
                float(fraction),
                min(most, len(self.faces) + 1000),
                most,
            )
        except _mesh.TooManyError as error:
            raise ArgumentError(str(error)) from None

    def _vertices_of(self, frame: Frame) -> list[tuple[NDArray[np.int32], int, Impacts]]:
        """Vertices of the collisions by kind, the number of the first feature's, and impacts."""
        edges, faces = self.edges, self.faces
        of_edges = edges[frame.ee].reshape(-1, 4)
        return [
            (np.concatenate([frame.vf[:, :1], faces[frame.vf[:, 1]]], 1), 1, frame.vf_impacts),
            (of_edges, 2, frame.ee_impacts),
            (np.concatenate([frame.pe[:, :1], edges[frame.pe[:, 1]]], 1), 1, frame.pe_impacts),
            (frame.pp, 1, frame.pp_impacts),
        ]

    def update_topology(
        self,
        faces: ArrayLike,
        groups: Groups | None = None,
        edges: ArrayLike | None = None,
        points: ArrayLike | None = None,
    ) -> dict[str, Any]:
        """Replace the faces, for example by a cut or tear that removes, adds or splits some.

        The hierarchy is updated and the front is reused. The first change that adds features
        rebuilds a tree with free slots; a later change rebuilds it if the slots are used up.
        Results, and the numbering of edges and faces, are from then on those of a new ``MeshCCD``
        of ``faces``. The number of vertices may change.

        Args:
            faces: Shape (F', 3), the complete new list. Rows that were present before count as
                unchanged.
            groups: Groups of all vertices; ``None`` keeps the present ones.
            edges: Isolated edges; ``None`` keeps the present ones.
            points: Isolated vertices; ``None`` keeps the present ones.

        Returns:
            ``"vertices"``, ``"edges"``, ``"faces"``: numbers (removed, added); isolated edges and
            vertices also count as faces. ``"rebuilt"``: how many of the three trees are rebuilt in
            the next frame because they had no free slots left.

        Raises:
            ArgumentError: as the constructor.
        """
        before = self._topology
        groups = before.groups if groups is None else groups
        edges = before.isolated.edges if edges is None else edges
        points = before.isolated.points if points is None else points
        checked, isolated = self._checked_parts(faces, edges, points, groups)
        rows = np.concatenate([checked, isolated.rows()])
        change = self._mesh.update_topology(rows, *_group_arrays(groups))
        self._topology = Topology(checked, isolated, frozen(change.pop("edge_rows")), groups)
        return change

    def _checked_parts(
        self, faces: ArrayLike, edges: ArrayLike, points: ArrayLike, groups: Groups | None
    ) -> tuple[NDArray[np.int32], Isolated]:
        checked = _checked_faces(faces, groups)
        return checked, Isolated.of(checked, edges, points, groups)

    def _checked_step(
        self, x_t0: ArrayLike, x_t1: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        start = finite("x_t0", x_t0, (None, 3))
        end = finite("x_t1", x_t1, (None, 3))
        self._topology.check(len(start), len(end))
        return start, end


def _checked_flag(fresh: bool) -> bool:
    if not isinstance(fresh, bool | np.bool_):
        raise ArgumentError(f"fresh: {fresh!r:.40}, expected True or False")
    return bool(fresh)


def _checked_limit(limit: int) -> int:
    number = isinstance(limit, int | np.integer) and not isinstance(limit, bool)
    if not number or not 0 <= limit <= 2**40:
        raise ArgumentError(f"limit: {limit!r:.40}, expected an int from 0 to {2**40}")
    return int(limit)


def _impacts(found: dict[str, Any]) -> Impacts:
    hit = np.ones(len(found["toi"]), dtype=bool)
    return Impacts(hit, found["toi"], found["point"], found["normal"], found["weights"])


def _group_arrays(groups: Groups | None) -> tuple[NDArray[np.int32], NDArray[np.uint8]]:
    return _NO_GROUPS if groups is None else (groups.ids, groups.meets.astype(np.uint8))


def _checked_faces(faces: ArrayLike, groups: Groups | None) -> NDArray[np.int32]:
    if groups is not None and not isinstance(groups, Groups):
        raise ArgumentError(
            f"groups: {type(groups).__name__}, expected Groups(ids, meets): a group for every "
            "vertex and a table of the groups that meet"
        )
    array = np.asarray(faces)
    if array.size == 0:
        array = np.zeros((0, 3), dtype=np.int32)
    checked = frozen_indices("faces", array, (None, 3), np.iinfo(np.int32).max)
    a, b, c = checked.T
    repeats = (a == b) | (b == c) | (c == a)
    if repeats.any():
        row = int(np.argmax(repeats))
        raise ArgumentError(f"faces: row {row} is {checked[row].tolist()}: it repeats a vertex")
    if groups is not None:
        groups.check("faces", checked)
    return checked
