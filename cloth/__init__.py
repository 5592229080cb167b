"""Continuous collision detection for deforming triangle meshes, on plain arrays."""

from tauguard.cloth.groups import Groups
from tauguard.cloth.mesh import VOLUMES, MeshCCD

__all__ = ["VOLUMES", "Groups", "MeshCCD"]
