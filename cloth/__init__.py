"""Continuous collision detection for deforming triangle meshes, on plain arrays."""

from tauguard.cloth.frame import Frame, FrameStats
from tauguard.cloth.impacts import METHODS, Impacts, edge_edge, point_edge, point_point, vertex_face
from tauguard.cloth.mesh import VOLUMES, MeshCCD
from tauguard.cloth.topology import Groups

__all__ = [
    "METHODS", "VOLUMES", "Frame", "FrameStats", "Groups", "Impacts", "MeshCCD", "edge_edge",
    "point_edge", "point_point", "vertex_face",
]  # fmt: skip
