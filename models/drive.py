"""The drive train: from motor current to joint torque, its friction, ripple and sensors.

All numbers refer to the joint side of the gear: ``tau = gain * current``, gain in N m per ampere.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array, Bools, in_a_line
from tauguard.findings import ArgumentError
from tauguard.models import cura6
from tauguard.models.checks import above_zero, not_negative, shaped
from tauguard.models.left_over import LeftOver, Player


@dataclass(frozen=True)
class Friction:
    """Joint friction with presliding (Dahl/LuGre bristles), Stribeck level, load and temperature.

    With the bristle deflection z [rad], velocity v and transmitted torque tau::

        g(v)  = [Fc + (Fs - Fc) exp(-(v / vs)^2) + sum_k s_k tanh(|v| / w_k)]
                (1 + load |tau|) (1 + kc (T - T0))
        dz/dt = v - k |v| / g(v) z            (exact over a step for a constant v)
        tau_friction = k z + viscous (1 + kv (T - T0)) v

    Source of the form: Canudas de Wit et al. 1995 (LuGre without micro-damping); load and
    temperature: Bittencourt & Gunnarsson 2012, Wolf & Iskandar 2018.
    """

    __repr__ = in_a_line

    coulomb: Array  #: Fc [N m], shape (n,)
    static: Array  #: Fs, level at rest [N m], shape (n,); if below Fc, friction rises with speed
    stribeck_velocity: Array  #: vs [rad/s], shape (n,)
    viscous: Array  #: [N m s/rad], shape (n,)
    bristle_stiffness: Array  #: k [N m/rad], shape (n,)
    load: Array  #: relative rise of the level per transmitted torque [1/(N m)], shape (n,)
    coulomb_per_kelvin: float = -0.002  #: kc [1/K]
    viscous_per_kelvin: float = -0.012  #: kv [1/K]
    reference_temperature: float = 35.0  #: T0 [degC]
    temperature: float = 35.0  #: T in this episode [degC]
    slope: Array | None = None  #: s, rises of the level with the speed [N m], shape (n, k)
    slope_velocity: Array | None = None  #: w [rad/s], shape (k,)

    def __post_init__(self) -> None:
        """Check shapes and signs: ``ArgumentError`` names the field."""
        per_joint = tuple(f.name for f in fields(self) if f.type == "Array")
        shaped(self, (len(self.coulomb),), "one per joint", *per_joint)
        if (self.slope is None) != (self.slope_velocity is None):
            raise ArgumentError("Friction.slope, slope_velocity: expected both or neither")
        if self.slope is not None and self.slope_velocity is not None:
            shape = (len(self.coulomb), len(self.slope_velocity))
            shaped(self, shape, "joints, slopes", "slope")
            not_negative(self, "slope")
            above_zero(self, "slope_velocity")
        above_zero(self, "stribeck_velocity")
        not_negative(self, "coulomb", "bristle_stiffness", "viscous", "load")
        if not ((self.bristle_stiffness > 0) | (self.coulomb == 0)).all():
            raise ArgumentError(
                f"Friction.bristle_stiffness {self.bristle_stiffness}: expected above 0 where "
                "there is Coulomb friction"
            )
        if not ((self.static > 0) | ((self.coulomb == 0) & (self.static == 0))).all():
            raise ArgumentError("Friction.static: expected above 0 where there is Coulomb friction")
        warm = self.temperature - self.reference_temperature
        for name in ("coulomb_per_kelvin", "viscous_per_kelvin"):
            if not 1 + getattr(self, name) * warm > 0:
                raise ArgumentError(
                    f"Friction.temperature {self.temperature} degC: friction would be negative for "
                    f"{name} = {getattr(self, name)}; expected a temperature nearer to "
                    f"{self.reference_temperature}"
                )


@dataclass(frozen=True)
class Ripple:
    """Torque ripple: ``gain * sum_h amplitude_h sin(cycles_h * gear * q + phase_h)``."""

    __repr__ = in_a_line

    cycles: Array  #: per motor revolution, shape (h,)
    amplitude: Array  #: [A], shape (n, h)
    phase: Array  #: [rad], shape (n, h)

    def __post_init__(self) -> None:
        """Check shapes and values: ``ArgumentError`` names the field."""
        shape = (len(self.phase), len(self.cycles))
        shaped(self, shape, "joints, harmonics", "amplitude", "phase")
        for name in ("cycles", "amplitude", "phase"):
            if not np.isfinite(getattr(self, name)).all():
                raise ArgumentError(f"Ripple.{name}: not finite")

    def at(self, angle: Array) -> Array:
        """The series [A] at angles of the motor or joint [rad], both of shape (..., n)."""
        turns = np.asarray(angle)[..., None] * self.cycles
        series: Array = (self.amplitude * np.sin(turns + self.phase)).sum(axis=-1)
        return series


@dataclass(frozen=True)
class Sensors:
    """Measurement noise and quantisation; a quantum of 0 does not quantise."""

    __repr__ = in_a_line

    current_noise: Array  #: standard deviation [A], shape (n,)
    current_quantum: Array  #: [A], shape (n,)
    position_quantum: float = 2e-6  #: [rad]
    velocity_noise: float = 5e-4  #: standard deviation [rad/s]
    velocity_quantum: float = 0.0  #: [rad/s]
    rate: float = 0.0  #: samples per second; 0: one at every physics step
    jitter: float = 0.0  #: standard deviation of a sample's time [s]
    left_over: LeftOver | None = None
    """Errors of the model of the current along recorded motions. They are added to the reported
    currents and do not affect the motion."""

    def __post_init__(self) -> None:
        """Check shapes and signs: ``ArgumentError`` names the field."""
        shaped(self, (len(self.current_noise),), "one per joint", "current_quantum")
        not_negative(self, *(f.name for f in fields(self) if f.name != "left_over"))
        joints = 0 if self.left_over is None else self.left_over.qd.shape[1]
        if self.left_over is not None and joints != len(self.current_noise):
            raise ArgumentError(
                f"Sensors.left_over: of {joints} joints, expected {len(self.current_noise)}"
            )

    def player(self, dt: float, rng: np.random.Generator) -> Player | None:
        """The player of one episode's left-over errors; None if there are none."""
        return None if self.left_over is None else Player(self.left_over, dt, rng)

    def samples(self, t: Array, rng: np.random.Generator) -> NDArray[np.intp]:
        """Increasing indices of the physics steps (at times ``t`` [s]) that are sampled."""
        if self.rate <= 0 or len(t) < 2 or self.rate * (t[1] - t[0]) > 1:
            return np.arange(len(t))
        times = np.arange(t[0], t[-1], 1 / self.rate)
        times[1:] += self.jitter * rng.normal(size=len(times) - 1)
        return np.unique(np.clip(np.rint((times - t[0]) / (t[1] - t[0])), 0, len(t) - 1)).astype(
            np.intp
        )

    def measure(
        self,
        rng: np.random.Generator,
        q: Array,
        qd: Array,
        current: Array,
        player: Player | None = None,
    ) -> tuple[Array, Array, Array]:
        """Measured signals from true ones of shape (T, n): noise is added, then they are quantised.

        Args:
            rng: random generator for the noise.
            q: positions [rad].
            qd: velocities [rad/s].
            current: [A].
            player: adds left-over errors, see :meth:`player`; it depends on earlier samples.

        Raises:
            ArgumentError: signals whose shapes differ, or are not (T, n) of these sensors.
        """
        if not (q.shape == qd.shape == current.shape and q.shape[1:] == self.current_noise.shape):
            raise ArgumentError(
                f"measure: shapes {q.shape}, {qd.shape}, {current.shape}; "
                f"expected (T, {len(self.current_noise)}) each"
            )
        measured = np.empty((3, *q.shape))
        measured[0] = q
        noise = rng.standard_normal(q.shape) * self.current_noise
        np.add(current, noise, out=measured[2])
        if player is not None:
            measured[2] += player.next(qd)
        np.add(qd, rng.standard_normal(q.shape) * self.velocity_noise, out=measured[1])
        quanta, given = self._grids
        rounded = measured / quanta
        np.rint(rounded, out=rounded)
        rounded *= quanta
        np.copyto(measured, rounded, where=given)
        return measured[0], measured[1], measured[2]

    @cached_property
    def _grids(self) -> tuple[Array, Bools]:
        """Quanta of q, qd and current, shape (3, 1, n), 1 for a quantum of 0; which are not 0."""
        each = (self.position_quantum, self.velocity_quantum, self.current_quantum)
        quanta = np.array([np.broadcast_to(one, self.current_noise.shape) for one in each])[:, None]
        return np.where(quanta > 0, quanta, 1.0), quanta > 0


#: Parts that :meth:`Drive.without` can leave out: all friction; three parts of it (the higher level
#: near standstill, the growth with the torque, the change with temperature); torque ripple; the
#: current loop's lag; noise and quantisation of the sensors.
PARTS = ("friction", "stribeck", "load", "warmth", "ripple", "lag", "sensors")


@dataclass(frozen=True)
class Drive:
    """The drives of an arm. A part that is ``None`` is not simulated."""

    __repr__ = in_a_line

    gain: Array  #: torque constant times gear [N m/A], shape (n,)
    gear: Array  #: gear ratio, shape (n,)
    current_limit: Array  #: [A], shape (n,)
    electrical_time_constant: float | None  #: of the closed current loop [s]
    friction: Friction | None = None
    ripple: Ripple | None = None
    sensors: Sensors | None = None
    rated_speed: Array | None = None
    """Largest speed at which the full torque is available [rad/s], shape (n,).

    Above it the back-EMF reduces the largest torque along the motion. The torque is 0 at
    ``no_load_speed`` and brakes beyond.
    """
    no_load_speed: Array | None = None  #: [rad/s], above the rated speed, shape (n,)

    def __post_init__(self) -> None:
        """Check shapes and signs: ``ArgumentError`` names the field."""
        joints = (len(self.gain),)
        if (self.rated_speed is None) != (self.no_load_speed is None):
            raise ArgumentError("Drive.rated_speed, no_load_speed: expected both or neither")
        if self.rated_speed is not None and self.no_load_speed is not None:
            shaped(self, joints, "one per joint", "rated_speed", "no_load_speed")
            above_zero(self, "rated_speed")
            if not (self.no_load_speed > self.rated_speed).all():
                raise ArgumentError("Drive.no_load_speed: expected above rated_speed")
        shaped(self, joints, "one per joint", "gear", "current_limit")
        if not (np.isfinite(self.gain).all() and (self.gain != 0).all()):
            raise ArgumentError(f"Drive.gain {self.gain}: expected N m/A other than 0")
        if not (self.current_limit > 0).all():
            raise ArgumentError(f"Drive.current_limit {self.current_limit}: expected above 0")
        constant = self.electrical_time_constant
        if constant is not None and not (np.isfinite(constant) and constant > 0):
            raise ArgumentError(
                f"Drive.electrical_time_constant {constant}: expected seconds above 0, or None"
            )
        rows: dict[str, Array] = {}
        if self.friction is not None:
            rows["friction"] = self.friction.coulomb
        if self.ripple is not None:
            rows["ripple"] = self.ripple.amplitude
        if self.sensors is not None:
            rows["sensors"] = self.sensors.current_noise
        for name, values in rows.items():
            if len(values) != joints[0]:
                raise ArgumentError(f"Drive.{name}: of {len(values)} joints, expected {joints[0]}")

    @classmethod
    def ideal(cls, torque_limit: Array, gain: float = 10.0) -> Drive:
        """Drives without losses, noise or lag, for an arm whose drives are not known.

        Args:
            torque_limit: may be infinite [N m], shape (n,).
            gain: gain of every joint [N m/A].
        """
        limit = np.asarray(torque_limit, dtype=float)
        same = np.full(limit.shape, gain)
        return cls(same, np.full(limit.shape, 101.0), limit / gain, None)

    def without(self, *parts: str) -> Drive:
        """The same drives with some parts left out.

        Args:
            parts: of :data:`PARTS`.

        Raises:
            ArgumentError: another name.
        """
        for name in parts:
            if name not in PARTS:
                raise ArgumentError(f"part {name!r}: expected one of {', '.join(PARTS)}")
        friction = None if "friction" in parts else self.friction
        if friction is not None:
            if "stribeck" in parts:
                friction = replace(friction, static=friction.coulomb)
            if "load" in parts:
                friction = replace(friction, load=np.zeros_like(friction.load))
            if "warmth" in parts:
                friction = replace(friction, temperature=friction.reference_temperature)
        return replace(
            self,
            friction=friction,
            ripple=None if "ripple" in parts else self.ripple,
            sensors=None if "sensors" in parts else self.sensors,
            electrical_time_constant=None if "lag" in parts else self.electrical_time_constant,
        )

    @property
    def torque_limit(self) -> Array:
        """[N m], shape (n,)."""
        return np.abs(self.gain) * self.current_limit


def cura6_drive(name: str = "cura6") -> Drive:
    """The nominal drives of the CURA6-like arm, or of one of its other sizes.

    Magnitudes: gains and friction as identified on a UR10e (Mamedov et al. 2020), current noise as
    measured on one at standstill, quanta 4.5 and 2.24 mA and ripple of 2, 5, 10, 20 cycles with
    0.05-0.09 A as measured on UR10-class joints; the rest is assumed (README.md of the arm).
    """
    coulomb = np.array([12.5, 13.3, 5.0, 2.0, 2.7, 2.3])
    gain = np.array([10.0, 10.7, 8.5, 9.0, 9.5, 10.1])
    scale = cura6.SIZES[name][0]
    coulomb, gain = scale * coulomb, scale * gain
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
            viscous=scale * np.array([21.3, 20.2, 10.4, 3.6, 2.5, 3.0]),
            bristle_stiffness=coulomb / 1.5e-3,
            load=np.array([0.0010, 0.0018, 0.0022, 0.002, 0.002, 0.002]) / scale,
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
