"""Code that cloth and rigid share: exact signs, bounding volumes, thread pool, checked arrays."""

from tauguard.geometry.arrays import finite, indices
from tauguard.geometry.frozen import Rebuilt, frozen, frozen_finite, frozen_indices, sealed
from tauguard.geometry.predicates import orient2d, orient3d
from tauguard.geometry.threads import thread_count

__all__ = [
    "Rebuilt", "finite", "frozen", "frozen_finite", "frozen_indices", "indices", "orient2d",
    "orient3d", "sealed", "thread_count",
]  # fmt: skip
