"""What a calibrated model gets wrong slowly: a load that was not told, warmer or colder friction.

A Kalman filter on the observer's residual. Only joints in motion correct it: static friction may
hold any torque, so a joint at rest says nothing of the load. A joint that has just started is left
out, too. A push is no slow error: large innovations count less.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Unknowns of the load: mass [kg] and first moment in the last link's frame [kg m].
LOAD = 4
#: Standard deviations around the calibration: of a joint's friction, relative, and of its torque
#: offset, in units of its friction.
FRICTION, OFFSET = 0.3, 0.1
#: Time constant with which all unknowns are forgotten [s]: gears warm up within minutes.
SLOW = 300.0
#: Time between two corrections [s].
EVERY = 0.05
#: Deviation of one correction, in units of the joint's friction: model errors of 0.3, which last
#: some six corrections.
ERROR = 0.3 * 6**0.5
#: An innovation z above this many standard deviations c counts c^2/z.
CLIP = 3.0
#: A joint counts so long after its start [s].
STARTED = 0.3


@dataclass(frozen=True)
class LoadDeviation:
    """How uncertain the carried load is."""

    mass: float = 0.0  #: standard deviation [kg]
    moment: float = 0.0  #: of each axis of the first moment [kg m]


#: The deviation of a load that nobody told.
UNKNOWN_LOAD = LoadDeviation(3.0, 0.3)


class SlowErrors:
    """Estimate of the slow errors of one arm, sample by sample.

    Attributes:
        state: load (4), relative friction error (n), torque offset (n).
    """

    def __init__(self, friction: Array, load: LoadDeviation) -> None:
        """Begin at the calibration.

        Args:
            friction: level of each joint's friction [N m], shape (n,).
            load: how uncertain the carried load is.
        """
        n = len(friction)
        moments = [load.moment] * 3
        own = np.concatenate([np.full(n, FRICTION), OFFSET * friction])
        self._variance = np.concatenate([[load.mass], moments, own]) ** 2
        self._noise = (ERROR * friction) ** 2
        self._design = np.zeros((n, LOAD + 2 * n))
        self._design[:, LOAD + n :] = np.eye(n)
        self._own = np.arange(n), LOAD + np.arange(n)
        self._since = 0.0
        self.covariance = np.diag(self._variance)
        self.state = np.zeros(LOAD + 2 * n)

    def step(
        self, residual: Array, load: Array, friction: Array, moved: Array, dt: float
    ) -> tuple[Array, Array]:
        """The residual without the slow errors, and the deviation that they leave, (n,) each.

        Args:
            residual: of the observer [N m], shape (n,).
            load: its change per unit of the load's mass and first moment, shape (n, 4).
            friction: its change per relative error of each joint's friction [N m], shape (n,).
            moved: how long each joint has been in motion [s], shape (n,).
            dt: time since the last sample [s].
        """
        design = self._design
        design[:, :LOAD] = load
        design[self._own] = friction
        left = residual - design @ self.state
        spread = np.sqrt(np.maximum(((design @ self.covariance) * design).sum(axis=1), 0.0))
        self._since += dt
        if self._since >= EVERY - 0.5 * dt:
            self._forget(self._since)
            self._since = 0.0
            for j in np.flatnonzero(moved > STARTED):
                self._correct(design[j], float(residual[j]), float(self._noise[j]))
        return left, spread

    def _forget(self, dt: float) -> None:
        keep = np.exp(-dt / SLOW)
        self.state *= keep
        self.covariance *= keep * keep
        self.covariance += np.diag(self._variance * (1 - keep * keep))

    def _correct(self, row: Array, residual: float, noise: float) -> None:
        gain = self.covariance @ row
        variance = float(row @ gain) + noise
        innovation = residual - float(row @ self.state)
        z = abs(innovation) / np.sqrt(variance)
        if z > CLIP:
            innovation *= (CLIP / z) ** 2
        self.state += gain * (innovation / variance)
        self.covariance -= np.outer(gain, gain) / variance
