"""What cloth and rigid share: exact signs, bounding volumes, thread pool."""

from tauguard.geometry.arrays import finite, indices
from tauguard.geometry.predicates import orient2d, orient3d

__all__ = ["finite", "indices", "orient2d", "orient3d"]
