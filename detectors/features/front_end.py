"""What the detectors on the residual share: a calibrated arm and what free motion leaves of it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tauguard.detectors.calibration.calibrate import calibrate, free_rows
from tauguard.detectors.detector import check_trace, common_interval
from tauguard.detectors.estimation.estimator import ArmModel, Estimate, Estimator, Unknowns
from tauguard.detectors.features.windows import Envelope
from tauguard.detectors.model_parts import arm_from_parts, arm_parts
from tauguard.traces.trace import Trace

Array = NDArray[np.float64]

#: Every so many samples of free motion are enough to fit an envelope.
THIN = 5


@dataclass
class FrontEnd:
    """From a trace to the residual in units of its envelope.

    The envelope is the standard deviation that free motion shows at this speed and acceleration
    (see :class:`~tauguard.detectors.features.windows.Envelope`), so a ratio of 5 means the same at
    rest and at full speed.

    Several detectors can hold one front end (:func:`shared_front_ends`): what it found for the same
    traces is kept, so that the second to ask pays nothing.
    """

    gain: float = 200.0  #: of the observer [1/s]
    adapt: bool = True  #: track payload, offsets and friction errors
    settle: float = 3.0  #: until the payload is found [s]
    joints: int = 4  #: the first so many joints are looked at (all, if there are fewer)
    arm: ArmModel | None = None
    envelope: Envelope | None = None
    dt: float = 1e-3  #: sample interval [s]
    _shared: bool = field(default=False, init=False, repr=False, compare=False)
    _trained: tuple[object, object, list[Estimate]] | None = field(
        default=None, init=False, repr=False, compare=False
    )
    _recent: tuple[Trace, Array] | None = field(default=None, init=False, repr=False, compare=False)

    def __getstate__(self) -> dict[str, Any]:
        """Without what is kept for the next to ask."""
        return {**self.__dict__, "_trained": None, "_recent": None}

    def forget(self) -> None:
        """Let go of the traces that were seen last."""
        self._trained = self._recent = None

    def fit(self, traces: Sequence[Trace], robot: ArmModel) -> list[Estimate]:
        """Identify the arm from the collision-free rows, and the envelope.

        Returns:
            The estimates of the traces, which training goes on with.

        Raises:
            ValueError: traces that do not fit, or without collision-free motion.
        """
        if self._trained and self._trained[0] is traces and self._trained[1] is robot:
            return self._trained[2]
        self.dt = common_interval(traces, robot)
        free = [np.flatnonzero(free_rows(trace, self.settle))[::THIN] for trace in traces]
        if not sum(len(rows) for rows in free):
            raise ValueError(
                f"no collision-free motion after the first {self.settle:g} s of any trace"
            )
        self.arm = calibrate(robot, traces, friction=robot.friction).arm
        estimates = [self._run(self.arm, trace) for trace in traces]
        tables = (
            [e.left for e in estimates],
            [t.qd for t in traces],
            [e.acceleration for e in estimates],
        )
        gathered = [
            np.concatenate([values[rows] for values, rows in zip(own, free, strict=True)])
            for own in tables
        ]
        self.envelope = Envelope.fit(*gathered)
        self._recent = None
        if self._shared:
            self._trained = traces, robot, estimates
        return estimates

    def fitted(self) -> tuple[ArmModel, Envelope]:
        """The arm and its envelope; ``ValueError`` before :meth:`fit`."""
        if self.arm is None or self.envelope is None:
            raise ValueError("this detector is not fitted: call fit or load a model file first")
        return self.arm, self.envelope

    def ratio(self, trace: Trace, estimate: Estimate | None = None) -> Array:
        """Residual over envelope of the joints looked at, shape (T, joints).

        Args:
            trace: of the arm, at the rate of training.
            estimate: of this trace, where it is known already.

        Raises:
            ValueError: not fitted, other joints or another rate.
        """
        arm, envelope = self.fitted()
        if self._recent and self._recent[0] is trace:
            return self._recent[1]
        check_trace(trace, arm.robot.joints, self.dt)
        known = estimate or self._run(arm, trace)
        ratio = known.left / envelope.scale(trace.qd, known.acceleration)
        found = np.ascontiguousarray(ratio[:, : self.joints])
        found.flags.writeable = False
        if self._shared:
            self._recent = trace, found
        return found

    def _run(self, arm: ArmModel, trace: Trace) -> Estimate:
        unknowns = Unknowns.wary() if self.adapt else Unknowns.none()
        estimator = Estimator(arm, self.gain, self.dt, unknowns)
        return estimator.run(trace.t, trace.q, trace.qd, trace.current)

    def parts(self) -> dict[str, Any]:
        """What a model file keeps of it."""
        arm, envelope = self.fitted()
        return {
            "gain": self.gain,
            "adapt": self.adapt,
            "settle": self.settle,
            "joints": self.joints,
            "dt": self.dt,
            "arm": arm_parts(arm),
            "envelope": envelope.weights,
        }

    @classmethod
    def from_parts(cls, parts: dict[str, Any]) -> FrontEnd:
        """The front end again from :meth:`parts`."""
        return cls(
            gain=float(parts["gain"]),
            adapt=bool(parts["adapt"]),
            settle=float(parts["settle"]),
            joints=int(parts["joints"]),
            dt=float(parts["dt"]),
            arm=arm_from_parts(parts["arm"]),
            envelope=Envelope(np.asarray(parts["envelope"], dtype=np.float64)),
        )


def shared_front_ends(detectors: Iterable[object]) -> list[FrontEnd]:
    """Give unfitted detectors with equal front ends one in common.

    Args:
        detectors: those with an attribute ``front`` are changed.

    Returns:
        The front ends that are left; :meth:`FrontEnd.forget` frees what they hold after training.
    """
    fronts: list[FrontEnd] = []
    for detector in detectors:
        own = getattr(detector, "front", None)
        if isinstance(own, FrontEnd) and own.arm is None:
            known = next((front for front in fronts if front == own), None)
            if known is None:
                own._shared = True
                fronts.append(own)
            else:
                detector.front = known  # type: ignore[attr-defined]
    return fronts


@dataclass
class OnFrontEnd:
    """A detector that starts from a front end, and takes arm and settling time from it."""

    front: FrontEnd = field(default_factory=FrontEnd)

    @property
    def settle(self) -> float:
        """Seconds at the beginning of a trace whose scores mean nothing yet."""
        return self.front.settle

    @property
    def arm(self) -> ArmModel:
        """The calibrated arm."""
        return self.front.fitted()[0]
