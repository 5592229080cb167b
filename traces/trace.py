"""The data types of a recording: measured signals, the truth, and a detector's output."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tauguard.arrays import Array, Bools, in_a_line
from tauguard.findings import ArgumentError
from tauguard.traces.contacts import CheckedContacts

KINDS = ("strike", "clamp", "pulse")
#: Fields of a trace with commands, which may be missing.
COMMANDED = ("q_des", "qd_des", "qdd_des")
#: Severity strata: intervals [low, high) of the peak ``|tau_ext|`` over joints 1-4 [N m].
STRATA = ((4.0, 8.0), (8.0, 16.0), (16.0, 32.0), (32.0, 64.0), (64.0, 128.0))
#: Joints of every UR arm by the names of UR's own ROS driver.
UR_JOINTS = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
#: Attachment of an environment's recording: JSON rows of a time [s] and the target of each tool
#: from this time on [m].
TARGETS = "targets.json"


def stratum(peak_tau: float) -> str:
    """Name of the severity stratum of ``peak_tau`` [N m]."""
    if peak_tau < STRATA[0][0]:
        return f"0-{STRATA[0][0]:g}"
    for low, high in STRATA:
        if low <= peak_tau < high:
            return f"{low:g}-{high:g}"
    return f"{STRATA[-1][1]:g}-"


@dataclass(frozen=True)
class Collision:
    """One labelled collision: its kind, time, place and force."""

    __repr__ = in_a_line

    kind: str  #: "strike" (a moving obstacle), "clamp" (a fixed one) or "pulse" (a wrench pulse)
    onset: float  #: time of the first sample with a contact force above 0 N [s]
    end: float  #: time of the last such sample [s]
    link: int  #: the link in contact, 1-based: link i moves with joint i
    point: Array  #: contact point at the sample of peak force, world frame [m], shape (3,)
    force: Array  #: peak contact force on the arm, world frame [N], shape (3,)
    peak_tau: float  #: severity: largest ``|tau_ext|`` over joints 1-4 [N m]


@dataclass(frozen=True)
class Truth:
    """True values that only a simulation knows; rows are the samples of :class:`Trace`."""

    tau_ext: Array  #: torque of contacts and applied wrenches at the joints [N m], shape (T, n)
    contact_force: Array  #: norm of the net external contact force on the arm [N], shape (T,)
    collisions: tuple[Collision, ...]
    payload: Array  #: mass carried at the flange, unknown to the observer [kg], shape (T,)
    contact_link: NDArray[np.int64]  #: link of the largest contact force, 0 for none, shape (T,)
    contact_point: Array  #: point of this contact, world frame [m], NaN for none, shape (T, 3)
    contact_vector: (
        Array  #: force of this contact on the arm, world frame [N], else 0, shape (T, 3)
    )
    obstacle_names: tuple[str, ...] = ()  #: obstacles and moving objects of the scene
    obstacle_poses: Array = field(default_factory=lambda: np.empty((0, 0, 4, 4)))
    """World poses of the obstacles, homogeneous, shape (T, len(obstacle_names), 4, 4)."""

    def __repr__(self) -> str:
        """One line."""
        peak = float(np.max(self.contact_force, initial=0.0))
        return (
            f"Truth({len(self.contact_force)} samples, {len(self.collisions)} collisions, "
            f"largest contact force {peak:.0f} N)"
        )


@dataclass(frozen=True)
class Trace:
    """One recording of an arm: measured signals, one row per sample, and the truth if it is known.

    The current is signed and measured at the same time as ``q``. ``gain * current`` is the torque
    that the drive applies at the joint, without joint friction.
    """

    joint_names: tuple[str, ...]
    t: Array  #: strictly increasing [s], shape (T,)
    q: Array  #: measured joint positions [rad], shape (T, n)
    qd: Array  #: measured joint velocities [rad/s], shape (T, n)
    current: Array  #: measured motor currents [A], shape (T, n)
    q_des: Array | None = None  #: commanded positions [rad], shape (T, n)
    qd_des: Array | None = None  #: commanded velocities [rad/s], shape (T, n)
    qdd_des: Array | None = None  #: commanded accelerations [rad/s^2], shape (T, n)
    truth: Truth | None = None
    contacts: tuple[CheckedContacts, ...] = ()  #: reported contacts, one entry per checker
    meta: Mapping[str, str] = field(default_factory=dict)
    """Properties of the run: seed, versions, hashes of configuration and model, and others."""
    attachments: Mapping[str, str] = field(default_factory=dict)
    """Text files of the run by name, such as the MJCF of the scene and the configuration."""
    detection: Detection | None = None  #: a detector's output for this trace

    def __post_init__(self) -> None:
        """Check shapes and values.

        Raises:
            ArgumentError: a wrong shape, a value that is not finite, or time that is not
                increasing; the message names the field and the first bad row.
        """
        rows, joints = len(self.t), len(self.joint_names)
        signals = self.signals
        if self.truth is not None:
            signals["truth.tau_ext"] = self.truth.tau_ext
        for name, value in signals.items():
            if value.shape != (rows, joints):
                raise ArgumentError(
                    f"{name}: shape {value.shape}, expected ({rows}, {joints}): "
                    f"{rows} samples of joints {', '.join(self.joint_names)}"
                )
        for name, value in {"t": self.t, **signals}.items():
            if not np.isfinite(value).all():
                row = int(np.argwhere(~np.isfinite(value))[0][0])
                raise ArgumentError(f"{name}: not finite in row {row}")
        back = np.flatnonzero(np.diff(self.t) <= 0)
        if back.size:
            raise ArgumentError(f"t: not increasing at row {back[0] + 1}")

    def __repr__(self) -> str:
        """One line: arm, samples, duration, and the number of collisions if it is known."""
        arm = self.meta.get("arm", "") or self.meta.get("environment", "")
        known = "no truth" if self.truth is None else f"{len(self.truth.collisions)} collisions"
        long = self.t[-1] - self.t[0] if len(self.t) else 0.0
        step = f" every {1e3 * self.dt:g} ms" if len(self.t) > 1 else ""
        return (
            f"Trace({f'{arm}, ' if arm else ''}{len(self.joint_names)} joints, {len(self.t)} "
            f"samples{step}, {long:.2f} s, {known})"
        )

    @property
    def signals(self) -> dict[str, Array]:
        """The signals that the trace has, by the name of their field, shape (T, n) each."""
        every = {name: getattr(self, name) for name in ("q", "qd", "current", *COMMANDED)}
        return {name: value for name, value in every.items() if value is not None}

    @property
    def dt(self) -> float:
        """Median sample interval [s]."""
        return float(np.median(np.diff(self.t)))


@dataclass(frozen=True)
class Alarm:
    """A period of alarm after the output filter, which joins alarms closer than its merge gap."""

    start: float  #: [s]
    end: float  #: [s]


@dataclass(frozen=True)
class Detection:
    """A detector's output for a trace; rows are the trace's samples."""

    detector: str  #: the detector's name
    t: Array  #: [s], shape (T,)
    residual: Array
    """The observer's estimate of ``tau_ext`` [N m], shape (T, n). ``srq-svr`` and the
    free-motion detector subtract the payload, offsets and friction errors that they track; other
    detectors subtract nothing."""
    score: Array  #: the detector's output; a score above ``threshold`` is a raw alarm, shape (T,)
    threshold: float
    alarm: Bools  #: alarm after the output filter, shape (T,)
    alarms: tuple[Alarm, ...]

    def __repr__(self) -> str:
        """One line."""
        return f"Detection({self.detector}, {len(self.t)} samples, {len(self.alarms)} alarms)"
