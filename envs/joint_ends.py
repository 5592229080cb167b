"""Joints at the ends of their ranges: what pushes them there is their own stop."""

from __future__ import annotations

import numpy as np

from tauguard.arrays import Array

#: A joint this near to an end of its range, or beyond it, may feel its stop [rad].
MARGIN = 0.005
#: The residual has forgotten a stop after so many of the observer's time constants.
FORGOTTEN = 15.0


class JointEnds:
    """Takes the torque of the joints' stops out of residuals, sample by sample.

    A stop acts on its own joint alone. From the sample that nears an end until the observer has
    forgotten, that joint's residual counts as zero: a collision that it alone would show is not
    seen meanwhile.
    """

    def __init__(self, ranges: Array, dt: float, gain: float) -> None:
        """For one arm.

        Args:
            ranges: of the joints [rad], infinite where free, shape (n, 2).
            dt: of the samples [s].
            gain: of the observer [1/s].
        """
        self._low, self._high = ranges[:, 0] + MARGIN, ranges[:, 1] - MARGIN
        self._hold = round(FORGOTTEN / (gain * dt))
        #: Samples that each joint's residual still counts as zero, shape (n,).
        self.left = np.zeros(len(ranges), dtype=np.int64)

    def clear(self, q: Array, residuals: Array) -> None:
        """Samples in turn: positions (T, n) [rad]; residuals (T, n) are changed in place."""
        near = (q < self._low) | (q > self._high)
        if not (near.any() or self.left.any()):
            return
        for row in range(len(q)):
            self.left = np.where(near[row], self._hold, np.maximum(self.left - 1, 0))
            residuals[row, self.left > 0] = 0.0
