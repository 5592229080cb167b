"""Random differences between the simulated arm and the nominal arm of the observer."""

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from tauguard.findings import ArgumentError
from tauguard.models.drive import Drive


@dataclass(frozen=True)
class Mismatch:
    """Size of the differences of an individual arm from the nominal one.

    Each number is the half-width of a uniform distribution, relative to the value (``com``:
    absolute).

    The inertia of a link is scaled with its mass and by a common factor. Its principal moments are
    scaled by independent factors, each at most a quarter of ``inertia``, so that the inertia stays
    physically possible.
    """

    seed: int
    mass: float = 0.05
    com: float = 0.005  #: shift of a centre of mass along each axis [m]
    inertia: float = 0.10
    gain: float = 0.05
    coulomb: float = 0.20
    viscous: float = 0.20
    ripple: float = 0.20

    def __post_init__(self) -> None:
        """Check the values: ``ArgumentError`` names the one that is out of range."""
        for name in ("mass", "inertia", "gain", "coulomb", "viscous", "ripple"):
            value = getattr(self, name)
            if not 0 <= value < 0.9:
                raise ArgumentError(f"Mismatch.{name} {value}: expected 0 to 0.9 (relative)")
        if not 0 <= self.com < 0.1:
            raise ArgumentError(f"Mismatch.com {self.com}: expected 0 to 0.1 m")

    def perturb_arm(self, spec: mujoco.MjSpec, links: list[str]) -> None:
        """Change the inertial numbers of the named bodies of ``spec`` in place."""
        rng = np.random.default_rng([self.seed, 0])
        for name in links:
            body = spec.body(name)
            mass, inertia = body.mass, _inertia_matrix(body)
            scale = 1 + self.mass * rng.uniform(-1, 1)
            shift = self.com * rng.uniform(-1, 1, 3)
            common = scale * (1 + self.inertia * rng.uniform(-1, 1))
            moments, axes = np.linalg.eigh(inertia)
            moments = _possible(moments * common * (1 + self.inertia / 4 * rng.uniform(-1, 1, 3)))
            turn = axes * np.linalg.det(axes)
            quat = np.zeros(4)
            mujoco.mju_mat2Quat(quat, turn.ravel())
            body.mass = mass * scale
            body.ipos = np.array(body.ipos) + shift
            body.fullinertia = np.full(6, np.nan)
            body.inertia, body.iquat = moments, quat

    def perturb_drive(self, drive: Drive) -> Drive:
        """A copy of the drives with random differences."""
        rng = np.random.default_rng([self.seed, 1])
        n = len(drive.gain)

        def spread(width: float) -> np.ndarray:
            return 1 + width * rng.uniform(-1, 1, n)

        gain = drive.gain * spread(self.gain)
        level, viscous = spread(self.coulomb), spread(self.viscous)
        height, turn = spread(self.ripple), rng.uniform(0, 2 * np.pi, (n, 1))
        friction, ripple = drive.friction, drive.ripple
        if friction is not None:
            friction = replace(
                friction,
                coulomb=friction.coulomb * level,
                static=friction.static * level,
                bristle_stiffness=friction.bristle_stiffness * level,
                viscous=friction.viscous * viscous,
                slope=None if friction.slope is None else friction.slope * level[:, None],
            )
        if ripple is not None:
            ripple = replace(
                ripple, amplitude=ripple.amplitude * height[:, None], phase=ripple.phase + turn
            )
        return replace(drive, gain=gain, friction=friction, ripple=ripple)


def _inertia_matrix(body: mujoco.MjsBody) -> np.ndarray:
    full = np.asarray(body.fullinertia, dtype=float)
    if np.isfinite(full).all() and full.any():
        xx, yy, zz, xy, xz, yz = full
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    flat = np.zeros(9)
    mujoco.mju_quat2Mat(flat, np.asarray(body.iquat, dtype=float))
    frame = flat.reshape(3, 3)
    return frame @ np.diag(np.asarray(body.inertia, dtype=float)) @ frame.T


def _possible(moments: np.ndarray) -> np.ndarray:
    """Principal moments that satisfy the triangle inequality; the largest may be reduced."""
    order = np.argsort(moments)
    out = moments.copy()
    out[order[2]] = min(out[order[2]], 0.999 * (out[order[0]] + out[order[1]]))
    return out
