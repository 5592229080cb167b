"""Overlap and time of impact of convex bodies and rigid meshes, on plain arrays."""

from tauguard.rigid.convex_parts import convex_parts
from tauguard.rigid.curved import Cones, Cylinders, Ellipsoids, HalfSpaces
from tauguard.rigid.manifolds import Contacts, contacts
from tauguard.rigid.mesh import MeshContacts, MeshOverlap, MeshTree
from tauguard.rigid.mesh_distance import MeshPairDistances
from tauguard.rigid.motion import Motion
from tauguard.rigid.near_pairs import near_pairs
from tauguard.rigid.queries import PlaneCache, sweep
from tauguard.rigid.rays import PointDistances, RayHits
from tauguard.rigid.results import Distances, Impacts, MeshDistances, MeshImpacts, Overlap, Witness
from tauguard.rigid.rounded import Capsules, Rounded, Spheres
from tauguard.rigid.shapes import Boxes, Hulls, Parallelepipeds, Polygons, Shape, Tetrahedra
from tauguard.rigid.solids_and_meshes import distance, overlap, time_of_impact

__all__ = [
    "Boxes", "Capsules", "Cones", "Contacts", "Cylinders", "Distances", "Ellipsoids",
    "HalfSpaces", "Hulls", "Impacts", "MeshContacts", "MeshDistances", "MeshImpacts", "MeshOverlap",
    "MeshPairDistances", "MeshTree", "Motion", "Overlap", "Parallelepipeds", "PlaneCache",
    "PointDistances", "Polygons", "RayHits", "Rounded", "Shape", "Spheres", "Tetrahedra",
    "Witness", "contacts", "convex_parts", "distance", "near_pairs", "overlap", "sweep",
    "time_of_impact",
]  # fmt: skip
