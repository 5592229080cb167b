"""Deforming meshes for tests and timings, generated in any size.

The motions are smooth formulas of time, not simulations. The surfaces fold, touch and pass through
themselves, so that queries find collisions. The arguments of a builder are the approximate number
of triangles and a seed; the same arguments give the same bytes.
"""

from tauguard.cloth.scenes import cloths, solids  # noqa: F401  (they register their scenes)
from tauguard.cloth.scenes.scene import SCENES, Scene

__all__ = ["SCENES", "Scene"]
