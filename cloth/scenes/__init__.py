"""Deforming meshes for tests and timings, generated in any size.

The motions are smooth formulas of time, not simulations. The surfaces fold, touch and pass through
themselves, so that queries find collisions. The arguments of a builder are the approximate number
of triangles and a seed; the same arguments give the same bytes.
"""

from collections.abc import Callable

from tauguard.cloth.scenes.ball import turning_ball
from tauguard.cloth.scenes.crumple import crumpling
from tauguard.cloth.scenes.cubes import cubes_on_cloth, packed_cubes
from tauguard.cloth.scenes.mats import twisting_mats
from tauguard.cloth.scenes.pleats import pleats
from tauguard.cloth.scenes.rod import twisting_rod
from tauguard.cloth.scenes.rollers import rollers
from tauguard.cloth.scenes.scene import Scene
from tauguard.cloth.scenes.skirt import seated_skirt

#: Builders by name: ``SCENES[name](triangles, seed)``.
SCENES: dict[str, Callable[[int, int], Scene]] = {
    "pleats": pleats,
    "turning_ball": turning_ball,
    "seated_skirt": seated_skirt,
    "twisting_mats": twisting_mats,
    "crumpling": crumpling,
    "cubes_on_cloth": cubes_on_cloth,
    "packed_cubes": packed_cubes,
    "rollers": rollers,
    "twisting_rod": twisting_rod,
}

__all__ = ["SCENES", "Scene"]
