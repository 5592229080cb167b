"""Overlap and time of impact of convex bodies and rigid meshes, on plain arrays."""
