"""Admittance: a virtual mass, spring and damper that yields to what pushes the arm."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from tauguard.arrays import Array
from tauguard.envs.controllers.checks import per_joint


class Admittance:
    """M qdd + D qd + K (q - q_rest) = tau_ext: gives the reference that a position loop follows.

    Hogan, "Impedance control" (1985), in its admittance form. K = 0 makes the arm float where it is
    pushed to. The step is implicit, so that no gain and no rate makes it unstable.
    """

    def __init__(
        self,
        q: ArrayLike,
        dt: float,
        mass: ArrayLike = 1.0,
        damping: ArrayLike = 20.0,
        stiffness: ArrayLike = 0.0,
        dead_band: ArrayLike = 0.0,
    ) -> None:
        """At rest at ``q``.

        Args:
            q: where it begins and where its spring rests [rad], (n,).
            dt: time between two calls of :meth:`step` [s].
            mass: M [kg m^2], a number or (n,), above 0.
            damping: D [N m s/rad], a number or (n,).
            stiffness: K [N m/rad], a number or (n,).
            dead_band: torque that counts as none [N m], a number or (n,): what an observer's
                residual shows without any contact.

        Raises:
            ValueError: gains of another shape or out of range, or a ``dt`` not above 0.
        """
        self.rest = np.array(q, dtype=float)
        n = len(self.rest)
        self.mass = per_joint(mass, n, "mass")
        if not (self.mass > 0).all() or not dt > 0:
            raise ValueError(f"mass {mass!r} and dt {dt}: expected above 0")
        self.damping = per_joint(damping, n, "damping")
        self.stiffness = per_joint(stiffness, n, "stiffness")
        self.dead_band = per_joint(dead_band, n, "dead_band")
        self._dt = dt
        self.q, self.qd = self.rest.copy(), np.zeros(n)

    def step(self, tau_ext: Array) -> tuple[Array, Array]:
        """The next reference position [rad] and velocity [rad/s] under ``tau_ext`` [N m], (n,)."""
        push = np.sign(tau_ext) * np.maximum(np.abs(tau_ext) - self.dead_band, 0)
        dt = self._dt
        force = push - self.stiffness * (self.q - self.rest)
        inertia = self.mass + dt * self.damping + dt * dt * self.stiffness
        self.qd = (self.mass * self.qd + dt * force) / inertia
        self.q = self.q + dt * self.qd
        return self.q.copy(), self.qd.copy()
