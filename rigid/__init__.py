"""Overlap and time of impact of convex bodies and rigid meshes, on plain arrays."""

from tauguard.rigid.impact import MeshImpacts, time_of_impact
from tauguard.rigid.mesh import MeshContacts, MeshOverlap, MeshTree
from tauguard.rigid.motion import Motion
from tauguard.rigid.plane_cache import PlaneCache
from tauguard.rigid.queries import overlap, sweep
from tauguard.rigid.results import Impacts, Overlap, Witness
from tauguard.rigid.shapes import Boxes, Hulls, Parallelepipeds, Polygons, Tetrahedra

__all__ = [
    "Boxes",
    "Hulls",
    "Impacts",
    "MeshContacts",
    "MeshImpacts",
    "MeshOverlap",
    "MeshTree",
    "Motion",
    "Overlap",
    "Parallelepipeds",
    "PlaneCache",
    "Polygons",
    "Tetrahedra",
    "Witness",
    "overlap",
    "sweep",
    "time_of_impact",
]
