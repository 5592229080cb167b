"""The result of a step of a mesh."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tauguard.cloth.impacts import Impacts


@dataclass(frozen=True)
class FrameStats:
    """Counts and times of a frame.

    Attributes:
        vf: Counts of the vertex-face side. Broad phase: ``node_tests``; ``front``, entries kept
            for the next frame; ``leaf_pairs``; pairs left out because they share a vertex
            (``adjacent``) or their groups never touch (``kept_apart``); ``candidates``. Candidates
            without contact: ``axes`` (apart on an axis; counted with sweeping volumes only),
            ``cubic_sign`` (the cubic has no root), ``roots`` (no contact at a root). Decided in
            other ways: ``at_start`` (touch at the start), ``sliding`` (on a plane across an axis),
            ``resolved`` (one by one, in ``intervals`` pieces of time), ``exact`` (in exact
            arithmetic; ``long_exact`` of them with integers of any length). ``hits``: collisions.
        ee: The same counts of the edge-edge side.
        seconds: Wall time of each phase: ``project`` (positions onto the axes), ``build``,
            ``refit``, ``traverse``, ``vf`` and ``ee`` (candidates and narrow phase of each side),
            ``total``; and ``vf_narrow``, ``ee_narrow``: the narrow phase alone, summed over
            threads [s].
        builds: Trees that were built anew in this frame.
        bytes: Memory that the mesh keeps between frames.
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

    def first_time(self) -> float:
        """Time of the first collision, in [0, 1] of the step; inf if there is none."""
        kinds = self.vf_impacts, self.ee_impacts, self.pe_impacts, self.pp_impacts
        return min(float(impacts.toi.min(initial=np.inf)) for impacts in kinds)
