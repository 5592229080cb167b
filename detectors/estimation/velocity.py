"""The noise of positions and velocities, and the joint velocity estimated from both.

At 1 kHz, most of a residual without a collision is velocity noise times inertia times the
observer's gain. Positions are measured more precisely than velocities. A Kalman filter of both
gives a velocity with less noise and, at constant acceleration, without lag.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from tauguard.arrays import Array
from tauguard.findings import ArgumentError
from tauguard.traces.trace import Trace

#: Random walk of the acceleration in the filter [rad/s^2 per root second]. A larger value detects
#: an impact earlier, a smaller one passes less noise.
AGILITY = 4.0
#: Largest sample interval for the filter [s]; above it, the measured velocity is used.
SLOWEST = 2.5e-3


@dataclass(frozen=True, eq=False)
class SensorNoise:
    """Standard deviations of the measured positions and velocities, one per joint."""

    position: Array  #: [rad], shape (n,)
    velocity: Array  #: [rad/s], shape (n,)

    def __post_init__(self) -> None:
        """Check: ``ArgumentError`` for values that are not above 0, or different lengths."""
        for name in ("position", "velocity"):
            value = np.array(getattr(self, name), dtype=np.float64)
            if value.ndim != 1 or not (np.isfinite(value).all() and (value > 0).all()):
                raise ArgumentError(f"SensorNoise.{name}: expected one number above 0 per joint")
            object.__setattr__(self, name, value)
        if len(self.position) != len(self.velocity):
            raise ArgumentError("SensorNoise: position and velocity of different numbers of joints")

    @classmethod
    def measured(cls, traces: Sequence[Trace]) -> SensorNoise:
        """Estimate the noise from third differences, which are almost 0 for smooth motion.

        Args:
            traces: traces of one arm at one rate, each of 4 samples or more.
        """

        def level(name: str, floor: float) -> Array:
            squares = [np.diff(getattr(t, name), 3, axis=0) ** 2 for t in traces]
            # With the median over pieces, impacts and steps in some pieces have no effect.
            pieces = np.concatenate(
                [
                    [p.mean(axis=0) for p in np.array_split(s, max(1, len(s) // 500))]
                    for s in squares
                ]
            )
            found: Array = np.sqrt(np.median(pieces, axis=0) / 20)
            return np.maximum(found, floor)

        return cls(level("q", 1e-9), level("qd", 1e-6))

    def fusion_gains(self, dt: float) -> list[float]:
        """Steady-state Kalman gains of q, qd and qdd for both innovations, six per joint.

        Args:
            dt: sample interval [s].
        """
        return [
            gain
            for position, velocity in zip(self.position, self.velocity, strict=True)
            for gain in _joint_gains(float(position), float(velocity), dt)
        ]


@lru_cache(maxsize=1024)  # every reset of a detector needs the same Riccati equation
def _joint_gains(position: float, velocity: float, dt: float) -> tuple[float, ...]:
    """The six gains of a joint whose encoder and tachometer have this noise [rad], [rad/s]."""
    from scipy.linalg import solve_discrete_are

    move = np.array([[1, dt, dt * dt / 2], [0, 1, dt], [0, 0, 1]])
    see = np.array([[1.0, 0, 0], [0, 1.0, 0]])
    push = AGILITY * np.sqrt(dt) * np.array([dt * dt / 6, dt / 2, 1.0])
    # In units of the noise, the equation is well conditioned.
    scale = np.diag([1 / position, 1 / velocity, dt / velocity])
    back = np.linalg.inv(scale)
    a, c = scale @ move @ back, see @ back
    noise = np.diag([position**2, velocity**2])
    p = solve_discrete_are(a.T, c.T, scale @ np.outer(push, push) @ scale, noise)
    gain = back @ (p @ c.T @ np.linalg.inv(c @ p @ c.T + noise))
    return tuple(float(g) for g in gain.ravel())
