"""Code that cloth and rigid share: exact signs, bounding volumes, thread pool, checked arrays."""

from tauguard.geometry.arrays import (
    Rebuilt,
    finite,
    frozen,
    frozen_finite,
    frozen_indices,
    indices,
    sealed,
    thread_count,
)
from tauguard.geometry.predicates import orient2d, orient3d

__all__ = [
    "Rebuilt", "finite", "frozen", "frozen_finite", "frozen_indices", "indices", "orient2d",
    "orient3d", "sealed", "thread_count",
]  # fmt: skip
