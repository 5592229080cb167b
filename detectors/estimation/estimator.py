"""Momentum observer with friction compensation, and a Kalman filter of the errors of the model.

The filter estimates a payload at the last link and, for each joint, a torque offset and relative
errors of viscous and Coulomb friction, which change with temperature. The residual of the observer
is linear in these unknowns; their columns pass through the observer's filter.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from tauguard.arrays import Array, in_a_line
from tauguard.detectors import _observer
from tauguard.detectors.dynamics.friction import FrictionModel
from tauguard.detectors.dynamics.robot import RobotNumbers, same_rows
from tauguard.detectors.estimation.noise_model import NoiseModel
from tauguard.detectors.estimation.observer import PLAIN_GAIN, intervals, per_joint
from tauguard.detectors.estimation.velocity import SensorNoise
from tauguard.findings import ArgumentError

#: Number of unknowns per joint: torque offset [N m], relative viscous and Coulomb error.
PER_JOINT = 3
#: Rows of :attr:`Estimate.motion`.
MOTION = 4
#: Unknowns of the payload: mass [kg] and first moment in the last link's frame [kg m].
PAYLOAD = 4


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Priors of the unknowns, and settings of the filter.

    Each unknown is an Ornstein-Uhlenbeck process with a standard deviation and a time constant. An
    unknown with a standard deviation of 0 is not estimated.
    """

    payload: float = 2.0  #: mass [kg]
    moment: float = 0.2  #: first moment of the payload, each axis [kg m]
    offset: float = 1.0  #: torque offset, in units of the joint's noise
    viscous: float = 0.1  #: relative
    coulomb: float = 0.1  #: relative
    slow: float = 60.0  #: time constant of payload and friction errors [s]
    fast: float = 1.0  #: time constant of the offset [s]
    clip: float = 3.0
    """Innovations of z > c standard deviations are replaced by c^2/z; this is c. The standard
    deviation is that of noise and unknowns, without ``noise_inflation``."""
    every: float = 0.01  #: time between two corrections [s]
    noise_inflation: float = 1.0
    """Factor of the noise variance of a correction: the number of successive corrections with the
    same model error, for sample intervals up to ``every``. 1 treats successive corrections as
    independent."""
    started: float = 0.0
    """Time that a joint has to move before its first correction [s], because static friction can
    hold an unknown torque. 0: corrections also use joints at rest."""
    transition: float = 0.0
    """Relative error of friction that has just changed. With c_j the difference between friction
    and friction filtered at 30/s [N m], (transition c_j)^2 is added to ``noise^2``."""
    weighted: bool = False
    """The unexplained residual of joint j is multiplied by noise_j / sqrt(noise_j^2 + s_j^2), with
    s_j the standard deviation that the uncertain payload gives it."""

    def __post_init__(self) -> None:
        """Check: ``ArgumentError``."""
        for name, least in (("noise_inflation", 1.0), ("transition", 0.0), ("started", 0.0)):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= least):
                raise ArgumentError(f"{name} {value}: expected a number, {least:g} or more")

    @classmethod
    def for_detection(cls) -> Unknowns:
        """Settings for detectors: model errors last 0.2 s and are a tenth of a friction change."""
        return cls(noise_inflation=20.0, transition=0.1, weighted=True)

    @classmethod
    def for_logs(cls, mass: float, moment: float) -> Unknowns:
        """Settings for real arms, whose model errors are 0.3 friction levels and last about 0.6 s.

        Args:
            mass: standard deviation of the load [kg].
            moment: standard deviation of each axis of its first moment [kg m].
        """
        return cls(
            payload=mass,
            moment=moment,
            offset=1 / 3,
            viscous=0.3,
            coulomb=0.3,
            slow=300.0,
            fast=300.0,
            every=0.05,
            noise_inflation=12.0,
            started=0.3,
        )

    @classmethod
    def none(cls) -> Unknowns:
        """Nothing is unknown: the plain momentum observer."""
        return cls(payload=0.0, moment=0.0, offset=0.0, viscous=0.0, coulomb=0.0)

    def deviations(self, noise: Array) -> list[float]:
        """Standard deviations in the native order."""
        own = [[self.offset * float(s), self.viscous, self.coulomb] for s in noise]
        return [self.payload, *[self.moment] * 3, *(x for joint in own for x in joint)]

    def persistences(self, joints: int) -> list[float]:
        """Time constants in the native order [s]."""
        return [self.slow] * PAYLOAD + [self.fast, self.slow, self.slow] * joints


@dataclass(frozen=True, eq=False)
class ArmModel:
    """The arm model that a detector assumes."""

    robot: RobotNumbers
    drive_gain: Array  #: N m per ampere at the joint, shape (n,)
    friction: FrictionModel | None = None  #: None: no friction model
    noise: Array | None = None  #: standard deviation of the residual without collision [N m], (n,)
    sensors: SensorNoise | None = None  #: fuses position and velocity; None: as measured
    noise_model: NoiseModel | None = None
    """Standard deviation of the residual without collision, by motion. None: ``noise``."""

    def __post_init__(self) -> None:
        """Check shapes: ``ArgumentError`` names the field."""
        joints = self.robot.joints
        gain = np.asarray(self.drive_gain, dtype=np.float64)
        if gain.shape != (joints,) or not np.isfinite(gain).all():
            raise ArgumentError(
                f"drive_gain: shape {gain.shape}, expected ({joints},) finite numbers"
            )
        object.__setattr__(self, "drive_gain", gain)
        noise = np.ones(joints) if self.noise is None else per_joint("noise", self.noise, joints)
        object.__setattr__(self, "noise", noise)
        if self.friction is not None and len(self.friction.weights) != joints:
            raise ArgumentError(
                f"friction: weights of {len(self.friction.weights)} joints, the robot has {joints}"
            )
        if self.sensors is not None and len(self.sensors.position) != joints:
            raise ArgumentError(
                f"sensors: noise of {len(self.sensors.position)} joints, the robot has {joints}"
            )


@dataclass(frozen=True)
class Estimate:
    """The estimator's output for a trace, one row per sample."""

    residual: Array  #: the observer's estimate of tau_ext [N m], shape (T, n)
    unexplained: Array  #: part of the residual that no unknown explains [N m], shape (T, n)
    motion: Array
    """Inputs of the noise model, shape (T, 4, n). All are 0 if nothing is unknown. M is the mass
    matrix with the estimated payload. Rows, for joint j:

    * ``sum_k |M_jk qdd_k|`` [N m], with qdd the velocity differentiated at 30/s;
    * norm of row j of M [kg m^2];
    * largest recent change of the joint's friction [N m], which decays in 0.3 s;
    * with ``sampled``, half the change of the joint's torque since the last sample [N m], else 0.
    """
    plain: Array  #: residual of a second observer without unknowns [N m], shape (T, n)
    unknowns: Array | None = field(default=None)  #: payload (4), then 3 a joint, shape (T, 4 + 3 n)

    __repr__ = in_a_line


class Estimator:
    """The estimator of one arm, for whole traces or sample by sample with bit-equal results."""

    def __init__(
        self,
        arm: ArmModel,
        gain: ArrayLike = PLAIN_GAIN,
        dt: float = 1e-3,
        unknowns: Unknowns | None = None,
        sampled: bool = False,
    ) -> None:
        """Build the native form.

        Args:
            arm: the model.
            gain: rate of the observer [1/s], a number or one per joint.
            dt: sample interval [s]; intervals of single samples may differ.
            unknowns: priors (default: payload, offsets and friction errors are estimated).
            sampled: for low sample rates: between two samples, torque and friction are the mean of
                the two samples' values. If False, they are the values of the earlier sample.
        """
        self.arm = arm
        self.dt = float(intervals(dt, 2)[0])
        self.unknowns = unknowns or Unknowns()
        joints = arm.robot.joints
        friction = arm.friction or FrictionModel.coulomb_viscous(np.zeros(joints), 0.0)
        assert arm.noise is not None
        # If corrections are less frequent, fewer of them have the same model error.
        rarer = max(1.0, self.dt / self.unknowns.every)
        self.native = _observer.Estimator(
            arm.robot.chain,
            friction.basis(joints),
            [float(g) for g in arm.drive_gain],
            [float(k) for k in per_joint("gain", gain, joints)],
            [float(w) for w in friction.weights.ravel()],
            self.unknowns.deviations(arm.noise),
            self.unknowns.persistences(joints),
            [float(s) for s in arm.noise],
            self.unknowns.clip,
            self.unknowns.every,
            max(1.0, self.unknowns.noise_inflation / rarer),
            self.unknowns.transition,
            self.unknowns.started,
            self.unknowns.weighted,
            arm.sensors.fusion_gains(self.dt) if arm.sensors else [],
            PLAIN_GAIN,
            sampled,
        )

    def run(
        self, t: ArrayLike, q: ArrayLike, qd: ArrayLike, current: ArrayLike, keep: bool = False
    ) -> Estimate:
        """Estimate along a trace from the initial state.

        Args:
            t: times [s], shape (T,), or a constant interval.
            q: positions [rad], shape (T, n).
            qd: velocities [rad/s], shape (T, n).
            current: [A], shape (T, n).
            keep: also return the unknowns.
        """
        joints = self.arm.robot.joints
        q, qd, current = same_rows(joints, q=q, qd=qd, current=current)
        residual, unexplained, plain = (np.empty_like(q) for _ in range(3))
        motion = np.empty((len(q), MOTION, joints))
        tracked = np.empty((len(q) if keep else 0, PAYLOAD + PER_JOINT * joints))
        dt = intervals(t, len(q))
        out = residual, unexplained, motion, plain
        self.native.run(dt, q, qd, current, *out, tracked)
        return Estimate(*out, tracked if keep else None)

    def reset(self) -> None:
        """Return to the initial state."""
        self.native.reset()

    def step(
        self,
        q: Array,
        qd: Array,
        current: Array,
        out: Array,
        dt: float | None = None,
    ) -> None:
        """Process one sample. ``out``, shape (6, n): residual, unexplained, four rows of motion.

        Raises:
            ArgumentError: wrong shapes or numbers that are not finite; the state is as before.
        """
        try:
            step = self.dt if dt is None else dt
            self.native.step(q, qd, current, step, out[0], out[1], out[2:])
        except TypeError:
            joints = self.arm.robot.joints
            raise ArgumentError(
                f"q, qd, current: expected float64 arrays of shape ({joints},)"
            ) from None
