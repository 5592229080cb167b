"""The result of a step of a mesh."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import in_a_line
from tauguard.cloth.impacts import Impacts


@dataclass(frozen=True)
class FrameStats:
    """Counts and times of a frame.

    Attributes:
        vf: Counts of vertex-face pairs, by name. ``hits`` is the number of collisions.

            Broad phase: ``node_tests``; ``front``, the entries kept for the next frame;
            ``leaf_pairs``, the overlapping pairs of leaves; ``adjacent``, the pairs left out
            because they share a vertex; ``kept_apart``, the pairs left out because of their groups;
            ``candidates``.

            Candidates without contact: ``axes``, apart on an axis (0 with moving volumes);
            ``cubic_sign``, without a root of the coplanarity cubic; ``roots``, without contact at a
            root.

            Other candidates: ``at_start``, in contact at the start; ``sliding``, decided in a plane
            perpendicular to an axis; ``resolved``, decided one by one by dividing the step into
            ``intervals``; ``exact``, decided in exact arithmetic, of which ``long_exact`` needed
            integers of any length.
        ee: The same counts of edge-edge pairs.
        seconds: Wall time of each phase [s]: ``project`` (positions onto the axes), ``build``,
            ``refit``, ``traverse``, ``vf`` and ``ee`` (candidates and narrow phase of each kind),
            and ``total``. ``vf_narrow`` and ``ee_narrow`` are the time of the narrow phase summed
            over threads [s].
        builds: Number of trees that were built in this frame.
        bytes: Memory that the mesh keeps between frames [bytes].
    """

    vf: dict[str, int]
    ee: dict[str, int]
    seconds: dict[str, float]
    builds: int
    bytes: int


@dataclass(frozen=True, eq=False)
class Frame:
    """Every collision of one step.

    Attributes:
        vf: Colliding vertices and faces, shape (M, 2), sorted.
        ee: Colliding edges (rows of ``MeshCCD.edges``), smaller first, shape (K, 2), sorted.
        vf_impacts: Impacts of the rows of ``vf``; ``hit`` is true in every row.
        ee_impacts: Impacts of the rows of ``ee``.
        pe: Colliding isolated vertices and isolated edges (rows of ``MeshCCD.edges``), shape
            (P, 2), sorted. Contacts of all other vertices with edges are in ``ee`` or ``vf``:
            such a vertex is an end of an edge or a corner of a face.
        pp: Colliding isolated vertices, smaller first, shape (Q, 2), sorted.
        pe_impacts: Impacts of ``pe``; weights are those of the point and the edge's ends, shape (P,
            3).
        pp_impacts: Impacts of ``pp``; weights are ones, shape (Q, 2).
        stats: Counts and times of the computation.
    """

    vf: NDArray[np.int32]
    ee: NDArray[np.int32]
    vf_impacts: Impacts
    ee_impacts: Impacts
    pe: NDArray[np.int32]
    pp: NDArray[np.int32]
    pe_impacts: Impacts
    pp_impacts: Impacts
    stats: FrameStats

    __repr__ = in_a_line

    def first_time(self) -> float:
        """Time of the first collision, in [0, 1] of the step; inf if there is none."""
        kinds = self.vf_impacts, self.ee_impacts, self.pe_impacts, self.pp_impacts
        return min(float(impacts.toi.min(initial=np.inf)) for impacts in kinds)
