"""The protocol of a detection method: fit to traces, then one score per sample.

The definition of an alarm is the same for all methods:
:class:`~tauguard.detectors.alarms.alarm.CollisionAlarm` adds a threshold and a confirmation
time.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from tauguard.arrays import Array
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.traces.trace import Trace


class Method(Protocol):
    """The settings of a method, which can be fitted to traces."""

    @property
    def name(self) -> str:
        """The method's name in reports."""

    def fit(self, traces: Sequence[Trace], arm: ArmModel) -> FittedMethod:
        """Train on traces of one arm at one sample rate.

        Args:
            traces: with truth if there are collisions in them. Every method needs collision-free
                motion. Some also need collisions.
            arm: model before training: nominal numbers, drive gains and, if known, friction.

        Raises:
            ValueError: traces of different arms or rates, or without data that the method needs.
        """


class FittedMethod(Protocol):
    """A trained method, immutable.

    A frozen dataclass can be written into a model file if its fields are finite numbers, text,
    arrays, tuples, lists, dictionaries and other such dataclasses.
    """

    @property
    def name(self) -> str:
        """The method's name."""

    @property
    def arm(self) -> ArmModel:
        """The arm model after training."""

    @property
    def dt(self) -> float:
        """Sample interval of the training traces [s]."""

    @property
    def settle(self) -> float:
        """Time at the beginning of a trace in which scores are not valid [s]."""

    def scores(self, trace: Trace) -> Array:
        """One score per sample, higher if a collision is more likely, shape (T,).

        Scores are causal: each depends only on this sample and earlier ones.

        Raises:
            ValueError: other joints or another sample rate than the training's.
        """

    def stream(self) -> ScoreStream:
        """A new stream of the scores, sample by sample."""


class ScoreStream(Protocol):
    """The scores of one recording, computed sample by sample."""

    def step(self, q: Array, qd: Array, current: Array, dt: float | None = None) -> float:
        """The score of this sample, equal to the result of :meth:`FittedMethod.scores`.

        Args:
            q: [rad], float64, shape (n,).
            qd: [rad/s], shape (n,).
            current: [A], shape (n,).
            dt: time since the last sample [s] (default: sample interval of the training traces).

        Raises:
            ValueError: wrong shapes or numbers that are not finite.
        """
