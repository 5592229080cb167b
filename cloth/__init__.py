"""Continuous collision detection for deforming triangle meshes, on plain arrays."""
