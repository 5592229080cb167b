"""The drive train: from motor current to joint torque, its friction, ripple and sensors.

Units are those of the joint side: ``tau = gain * current`` with the gain in N m per ampere.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def _per_joint(owner: object, names: tuple[str, ...], joints: int) -> None:
    for name in names:
        shape = np.shape(getattr(owner, name))
        if shape != (joints,):
            raise ValueError(
                f"{type(owner).__name__}.{name}: shape {shape}, expected ({joints},): one a joint"
            )


@dataclass(frozen=True)
class Friction:
    """Joint friction with presliding (Dahl/LuGre bristles), Stribeck level, load and temperature.

    With the bristle deflection z [rad], velocity v and transmitted torque tau::

        g(v)  = [Fc + (Fs - Fc) exp(-(v / vs)^2)] (1 + load |tau|) (1 + kc (T - T0))
        dz/dt = v - k |v| / g(v) z            (exact over a step for a constant v)
        tau_friction = k z + viscous (1 + kv (T - T0)) v

    Source of the form: Canudas de Wit et al. 1995 (LuGre without micro-damping); load and
    temperature: Bittencourt & Gunnarsson 2012, Wolf & Iskandar 2018.
    """

    coulomb: Array  #: Fc [N m], shape (n,)
    static: Array  #: Fs, breakaway level, at least Fc [N m], shape (n,)
    stribeck_velocity: Array  #: vs [rad/s], shape (n,)
    viscous: Array  #: [N m s/rad], shape (n,)
    bristle_stiffness: Array  #: k [N m/rad], shape (n,)
    load: Array  #: relative rise of the level per transmitted torque [1/(N m)], shape (n,)
    coulomb_per_kelvin: float = -0.002  #: kc [1/K]
    viscous_per_kelvin: float = -0.012  #: kv [1/K]
    reference_temperature: float = 35.0  #: T0 [degC]
    temperature: float = 35.0  #: T of this episode [degC]

    def __post_init__(self) -> None:
        """Check shapes and signs: ``ValueError`` names the field."""
        per_joint = tuple(f.name for f in fields(self) if f.type == "Array")
        _per_joint(self, per_joint, len(self.coulomb))
        if (self.static < self.coulomb).any():
            raise ValueError("Friction.static: below coulomb; the breakaway level is at least it")
        if (self.bristle_stiffness <= 0).any() or (self.stribeck_velocity <= 0).any():
            raise ValueError("Friction: bristle_stiffness and stribeck_velocity must be above 0")


@dataclass(frozen=True)
class Ripple:
    """Torque ripple: ``gain * sum_h amplitude_h sin(cycles_h * gear * q + phase_h)``."""

    cycles: Array  #: per motor revolution, shape (h,)
    amplitude: Array  #: [A], shape (n, h)
    phase: Array  #: [rad], shape (n, h)


@dataclass(frozen=True)
class Sensors:
    """Measurement noise and quantisation; a quantum of 0 does not quantise."""

    current_noise: Array  #: standard deviation [A], shape (n,)
    current_quantum: Array  #: [A], shape (n,)
    position_quantum: float = 2e-6  #: [rad]
    velocity_noise: float = 5e-4  #: standard deviation [rad/s]

    def measure(
        self, rng: np.random.Generator, q: Array, qd: Array, current: Array
    ) -> tuple[Array, Array, Array]:
        """What the sensors say of true signals of shape (T, n); noise first, then the quantum."""
        noisy = current + rng.normal(size=current.shape) * self.current_noise
        quantum = np.where(self.current_quantum > 0, self.current_quantum, 1.0)
        read = np.where(self.current_quantum > 0, np.round(noisy / quantum) * quantum, noisy)
        position = (
            np.round(q / self.position_quantum) * self.position_quantum
            if self.position_quantum > 0
            else q.copy()
        )
        return position, qd + rng.normal(size=qd.shape) * self.velocity_noise, read


@dataclass(frozen=True)
class Drive:
    """The drives of an arm. A part that is ``None`` is left out and costs nothing."""

    gain: Array  #: torque constant times gear [N m/A], shape (n,)
    gear: Array  #: gear ratio, shape (n,)
    current_limit: Array  #: [A], shape (n,)
    electrical_time_constant: float | None  #: of the closed current loop [s]
    friction: Friction | None = None
    ripple: Ripple | None = None
    sensors: Sensors | None = None

    def __post_init__(self) -> None:
        """Check shapes and signs: ``ValueError`` names the field."""
        joints = len(self.gain)
        _per_joint(self, ("gain", "gear", "current_limit"), joints)
        if (self.gain == 0).any():
            raise ValueError("Drive.gain: 0 N m/A drives nothing")
        if self.friction is not None:
            _per_joint(self.friction, ("coulomb",), joints)

    @property
    def torque_limit(self) -> Array:
        """[N m], shape (n,)."""
        return np.abs(self.gain) * self.current_limit


def cura6_drive() -> Drive:
    """The CURA6-like arm's nominal drives.

    Magnitudes: gains and friction as identified on a UR10e (Mamedov et al. 2020), current noise as
    measured on one at standstill, quanta 4.5 and 2.24 mA and ripple of 2, 5, 10, 20 cycles with
    0.05-0.09 A as measured on UR10-class joints; the rest is assumed (README.md of the arm).
    """
    coulomb = np.array([12.5, 13.3, 5.0, 2.0, 2.7, 2.3])
    gain = np.array([10.0, 10.7, 8.5, 9.0, 9.5, 10.1])
    size = np.array([1.0, 1.0, 0.7, 0.25, 0.25, 0.25])
    return Drive(
        gain=gain,
        gear=np.full(6, 101.0),
        current_limit=np.array([33.0, 30.8, 17.6, 6.2, 5.9, 5.5]),
        electrical_time_constant=5e-4,
        friction=Friction(
            coulomb=coulomb,
            static=1.12 * coulomb,
            stribeck_velocity=np.full(6, 0.03),
            viscous=np.array([21.3, 20.2, 10.4, 3.6, 2.5, 3.0]),
            bristle_stiffness=coulomb / 1.5e-3,
            load=np.array([0.0010, 0.0018, 0.0022, 0.002, 0.002, 0.002]),
        ),
        ripple=Ripple(
            cycles=np.array([2.0, 5.0, 10.0, 20.0]),
            amplitude=np.outer(size, [0.09, 0.07, 0.05, 0.05]),
            phase=np.outer(np.arange(6.0), [0.7, 1.9, 2.3, 0.4]),
        ),
        sensors=Sensors(
            current_noise=np.array([0.047, 0.045, 0.024, 0.014, 0.012, 0.012]),
            current_quantum=np.array([0.0045, 0.0045, 0.00224, 0.00224, 0.00224, 0.00224]),
        ),
    )
