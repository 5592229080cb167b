"""The current-predicting network (Czubenko & Kowalczuk 2021): a residual in amperes.

A network learns on collision-free motion what current every motor draws, from the joint positions,
windows of velocities and accelerations, and (the auto-regressive form) the currents of a moment
ago: those carry the payload, the temperature and the friction of the day, which no position tells.
That form predicts the change since then, so that what stays the same need not be learnt.
The score is the largest difference between measured and predicted current over the joints, so its
threshold is in amperes (1.6 A and 2.0 A in the original).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tauguard.detectors.calibration.calibrate import free_rows
from tauguard.detectors.detector import check_trace, common_interval
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.methods.current_threshold import smoothed
from tauguard.detectors.methods.network import Network
from tauguard.detectors.model_parts import arm_from_parts, arm_parts
from tauguard.traces.trace import Trace

Array = NDArray[np.float64]

#: The original's thresholds on the residual current [A].
THRESHOLDS = (1.6, 2.0)
#: Rate of the filter that differentiates the velocity [1/s].
DERIVATIVE = 100.0
#: Friction changes its sign within about this velocity [rad/s].
REVERSAL = 0.02
#: Added to the sum of |acceleration| when samples are drawn, so that rest is seen too [rad/s^2].
STILL = 0.5


@dataclass
class CurrentNetwork:
    """Predicts every motor's current from the motion; what is left over is the score."""

    lags: tuple[float, ...] = (0.0, 0.025, 0.05)  #: ages of the window's samples [s]
    memory: float = 0.05  #: age of the past sample that is fed back [s]; 0: none, the static form
    hidden: tuple[int, ...] = (64, 32)
    rows: int = 30_000  #: collision-free samples to train on
    epochs: int = 60
    seed: int = 0
    settle: float = 0.5  #: [s]
    network: Network | None = None
    dt: float = 1e-3
    known: ArmModel | None = None  #: as given; nothing of it is used
    name: str = "current-network"

    @classmethod
    def static(cls) -> CurrentNetwork:
        """The form without past currents: a payload that it is not told is a residual."""
        return cls(memory=0.0, name="current-network-static")

    @property
    def arm(self) -> ArmModel:
        """The arm as it was given."""
        if self.known is None:
            raise ValueError("this detector is not fitted: call fit or load a model file first")
        return self.known

    def fit(self, traces: Sequence[Trace], robot: ArmModel) -> CurrentNetwork:
        """Train on collision-free samples of all traces, more of them where the arm accelerates.

        A sample's chance grows with the square root of the sum of |acceleration|: fast starts and
        stops are rare, and are where the errors are.
        """
        self.dt, self.known = common_interval(traces, robot), robot
        rng = np.random.default_rng([self.seed, 7])
        free = [np.flatnonzero(free_rows(trace, self.settle)) for trace in traces]
        if not sum(len(rows) for rows in free):
            raise ValueError("no collision-free motion in the traces")
        lively = [
            np.sqrt(np.abs(self._acceleration(trace)[rows]).sum(axis=1) + STILL)
            for trace, rows in zip(traces, free, strict=True)
        ]
        total = sum(float(weight.sum()) for weight in lively)
        x, y = [], []
        for trace, rows, weight in zip(traces, free, lively, strict=True):
            if not len(rows):
                continue
            share = min(len(rows), int(np.ceil(self.rows * weight.sum() / total)))
            own = np.sort(rng.choice(rows, share, replace=False, p=weight / weight.sum()))
            x.append(self._inputs(trace, own))
            y.append(trace.current[own] - self._base(trace, own))
        self.network = Network.fit(
            np.concatenate(x), np.concatenate(y), self.hidden, seed=self.seed, epochs=self.epochs
        )
        return self

    def _inputs(self, trace: Trace, rows: NDArray[np.intp]) -> Array:
        """What the network sees at ``rows``, shape (len(rows), d).

        Position as sine and cosine, direction of motion, velocity and acceleration at the window's
        ages, and the past sample's currents and position.
        """
        q, qd = trace.q[rows], trace.qd[rows]
        parts = [np.sin(q), np.cos(q), np.tanh(qd / REVERSAL)]
        acceleration = self._acceleration(trace)
        for lag in self.lags:
            past = np.maximum(rows - round(lag / self.dt), 0)
            parts += [trace.qd[past], acceleration[past]]
        if self.memory > 0:
            past = self._past(rows)
            parts += [trace.current[past], trace.q[past] - q]
            parts.append(np.tanh(trace.qd[past] / REVERSAL))
        return np.concatenate(parts, axis=1)

    def _acceleration(self, trace: Trace) -> Array:
        """The filtered derivative of the velocity [rad/s^2], shape (T, n)."""
        return DERIVATIVE * (trace.qd - smoothed(trace.qd, DERIVATIVE, self.dt))

    def _past(self, rows: NDArray[np.intp]) -> NDArray[np.intp]:
        """The rows that are ``memory`` older."""
        return np.maximum(rows - max(1, round(self.memory / self.dt)), 0)

    def _base(self, trace: Trace, rows: NDArray[np.intp]) -> Array:
        """What the network's output is added to [A], shape (len(rows), n)."""
        if self.memory > 0:
            return trace.current[self._past(rows)]
        return np.zeros((len(rows), trace.current.shape[1]))

    def scores(self, trace: Trace) -> Array:
        """The largest |measured - predicted current| over the joints [A], shape (T,)."""
        if self.network is None:
            raise ValueError("this detector is not fitted: call fit or load a model file first")
        check_trace(trace, len(self.network.biases[-1]), self.dt)
        rows = np.arange(len(trace.t))
        predicted = self._base(trace, rows) + self.network(self._inputs(trace, rows))
        score: Array = np.abs(trace.current - predicted).max(axis=1)
        return score

    def parts(self) -> dict[str, Any]:
        """What a model file keeps."""
        arm = arm_parts(self.arm)
        assert self.network is not None
        return {
            "lags": list(self.lags),
            "memory": self.memory,
            "name": self.name,
            "settle": self.settle,
            "dt": self.dt,
            "network": self.network.parts(),
            "arm": arm,
        }

    @classmethod
    def from_parts(cls, parts: dict[str, Any]) -> CurrentNetwork:
        """The detector again from :meth:`parts`."""
        return cls(
            lags=tuple(float(lag) for lag in parts["lags"]),
            memory=float(parts["memory"]),
            name=str(parts["name"]),
            settle=float(parts["settle"]),
            dt=float(parts["dt"]),
            network=Network.from_parts(parts["network"]),
            known=arm_from_parts(parts["arm"]),
        )
