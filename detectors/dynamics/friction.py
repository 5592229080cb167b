"""A nominal friction model: presliding, Coulomb, Stribeck, viscous, load-dependent, ripple.

The torque is linear in the weights, so that least squares can identify them. Presliding does not
depend on the rate of motion, so that a joint at rest keeps the friction with which it stopped.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from tauguard.arrays import Array
from tauguard.detectors import _observer
from tauguard.detectors.dynamics.robot import same_rows
from tauguard.findings import ArgumentError


@dataclass(frozen=True, eq=False)
class FrictionModel:
    """Friction torque of n joints: per joint a weighted sum of the same columns.

    Columns: 1; qd; a Dahl bristle b for each settling length; a stop operator for each width;
    b exp(-(qd/w)^2) for each Stribeck velocity; tanh(qd/w) for each slope; ``|load| b``;
    ``|load| tanh(qd/w)`` for each loaded slope; cos(c q) and sin(c q) for each ripple frequency c
    of the joint; ``tau |tau|`` with ``saturation``.
    """

    bristles: tuple[float, ...] = (1.5e-3, 3e-3)  #: settling lengths [rad]
    stops: tuple[float, ...] = (1e-3,)  #: widths [rad]
    stribeck: tuple[float, ...] = (0.02, 0.05)  #: [rad/s]
    slopes: tuple[float, ...] = (0.05, 0.3)  #: [rad/s]
    loaded: tuple[float, ...] = ()  #: slopes of load-dependent friction [rad/s]
    saturation: bool = False  #: the torque per ampere changes with the current
    modelled: bool = False
    """The load is the model's torque of gravity and inertia instead of the drive torque. If the
    drive torque is mostly friction, a load from it would predict friction from friction, and would
    count the torque of a contact as friction."""
    cycles: Array = field(default_factory=lambda: np.empty((0, 0)))
    """Ripple frequencies [1/rad at the joint], shape (n, h); empty: none."""
    play: float = 5e-6  #: dead zone of the bristles' position, a few quanta of the sensor [rad]
    weights: Array = field(default_factory=lambda: np.empty((0, 0)))
    """Weights [N m per unit of the column], shape (n, columns)."""

    def __post_init__(self) -> None:
        """Check all fields: ``ArgumentError`` names the field."""
        for name in ("bristles", "stops", "stribeck", "slopes", "loaded"):
            widths = tuple(float(w) for w in getattr(self, name))
            if not all(np.isfinite(w) and w > 0 for w in widths):
                raise ArgumentError(f"FrictionModel.{name}: {widths}, expected widths above 0")
            object.__setattr__(self, name, widths)
        if not self.bristles and not self.stops:
            raise ArgumentError("FrictionModel: at least one bristle or one stop is needed")
        weights = np.array(self.weights, dtype=np.float64, ndmin=2)
        cycles = np.array(self.cycles, dtype=np.float64, ndmin=2)
        if not (np.isfinite(weights).all() and np.isfinite(cycles).all()):
            raise ArgumentError("FrictionModel: weights and cycles must be finite")
        object.__setattr__(self, "cycles", cycles)
        if weights.size and weights.shape[1] != self.columns:
            raise ArgumentError(
                f"FrictionModel.weights: {weights.shape[1]} columns, expected {self.columns}"
            )
        object.__setattr__(self, "weights", weights)

    @property
    def columns(self) -> int:
        """Number of weights per joint."""
        groups = self.bristles, self.stops, self.stribeck, self.slopes, self.loaded
        return 3 + sum(map(len, groups)) + 2 * int(self.cycles.shape[1]) + int(self.saturation)

    @property
    def load_columns(self) -> slice:
        """Columns that are proportional to the load."""
        before = 2 + sum(map(len, (self.bristles, self.stops, self.stribeck, self.slopes)))
        return slice(before, before + 1 + len(self.loaded))

    def basis(self, joints: int) -> _observer.FrictionBasis:
        """The native form of the columns."""
        if self.cycles.size and len(self.cycles) != joints:
            raise ArgumentError(
                f"FrictionModel.cycles: {len(self.cycles)} rows for {joints} joints"
            )
        return _observer.FrictionBasis(
            list(self.bristles),
            list(self.stops),
            list(self.stribeck),
            list(self.slopes),
            list(self.loaded),
            self.saturation,
            self.modelled,
            [float(c) for c in self.cycles.ravel()],
            self.play,
            joints,
        )

    def evaluate(
        self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, load: ArrayLike | None = None
    ) -> Array:
        """The value of each column at each sample.

        Args:
            q: positions [rad], shape (T, n).
            qd: velocities [rad/s], shape (T, n).
            tau: drive torques [N m], shape (T, n).
            load: load of load-dependent friction [N m], shape (T, n) (default: tau).

        Returns:
            Shape (T, n, columns).
        """
        joints = np.asarray(q).shape[-1]
        force = tau if load is None else load
        q, qd, tau, force = same_rows(joints, q=q, qd=qd, tau=tau, load=force)
        out = np.empty((*q.shape, self.columns))
        self.basis(joints).evaluate(q, qd, tau, force, out)
        return out

    def torque(
        self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, load: ArrayLike | None = None
    ) -> Array:
        """Friction torque of a motion [N m], shape (T, n); positive at positive velocity."""
        columns = self.evaluate(q, qd, tau, load)
        if self.weights.shape != columns.shape[1:]:
            raise ArgumentError(
                f"FrictionModel.weights: shape {self.weights.shape}, "
                f"expected {columns.shape[1:]}: identify them first"
            )
        torque: Array = np.einsum("tjc,jc->tj", columns, self.weights)
        return torque

    def coulomb(self, speed: float = 0.1, load: ArrayLike = 0.0) -> Array:
        """Mean of the friction in both directions at a speed [N m], shape (n,).

        Args:
            speed: [rad/s].
            load: torque of the joints without friction [N m], shape (n,) or a number.
        """
        n = len(self.weights)
        q = np.linspace(0.0, 0.5, 500)[:, None].repeat(n, axis=1)
        carried = 0 * q + np.asarray(load, dtype=np.float64)
        level: Array = np.zeros(n)
        for _ in range(5):  # fixed point: the drive torque includes the friction
            there, back = (
                self.torque(
                    sign * q,
                    np.full_like(q, sign * speed),
                    sign * level + carried,
                    carried if self.modelled else None,
                )[-1]
                for sign in (1.0, -1.0)
            )
            level = 0.5 * np.abs(there - back)
        return level

    @classmethod
    def coulomb_viscous(
        cls, coulomb: ArrayLike, viscous: ArrayLike, load: ArrayLike = 0.0, width: float = 0.05
    ) -> FrictionModel:
        """A model from published coefficients of Coulomb, viscous and load-dependent friction.

        Args:
            coulomb: [N m], shape (n,).
            viscous: [N m s/rad], shape (n,).
            load: load-dependent friction per drive torque [1], a number or shape (n,).
            width: Coulomb friction is ``coulomb tanh(qd / width)`` [rad/s].
        """
        level = np.asarray(coulomb, dtype=np.float64)
        model = cls(bristles=(), stops=(2e-3,), stribeck=(), slopes=(width,))
        weights = np.zeros((len(level), model.columns))
        weights[:, 1] = viscous
        weights[:, 3] = level
        weights[:, 4] = load
        return cls(bristles=(), stops=(2e-3,), stribeck=(), slopes=(width,), weights=weights)
