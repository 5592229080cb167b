"""The protocol of a detection method: fit on traces, then one score a sample, in batch or online.

A method ranks samples. The definition of an alarm is the same for all methods:
:class:`~tauguard.detectors.alarms.alarm.CollisionAlarm` adds a threshold and a confirmation
time.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from tauguard.arrays import Array
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.traces.trace import Trace


class Detector(Protocol):
    """The settings of a method; it can be trained."""

    @property
    def name(self) -> str:
        """Its name in reports."""

    def fit(self, traces: Sequence[Trace], arm: ArmModel) -> FittedDetector:
        """Learn from traces of one arm at one sample rate.

        Args:
            traces: with truth where collisions are in them; every method needs collision-free
                motion, those that learn a ranking need collisions too.
            arm: the model before training: nominal numbers, drive gains and, where known, friction.

        Raises:
            ValueError: traces that do not fit or lack what this method needs.
        """


class FittedDetector(Protocol):
    """A trained method: complete and immutable.

    A frozen dataclass of numbers, text, arrays, tuples and other such dataclasses can be written
    into a model file.
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
        """One score a sample, shape (T,): higher is more like a collision.

        Causal: a score depends on this sample and those before it.

        Raises:
            ValueError: other joints or another sample rate than the training's.
        """

    def stream(self) -> ScoreStream:
        """The same scores sample by sample, from the next sample on."""


class ScoreStream(Protocol):
    """The scores of one recording as its samples come in."""

    def step(self, q: Array, qd: Array, current: Array, dt: float | None = None) -> float:
        """The score of this sample, equal to that of :meth:`FittedDetector.scores`.

        Args:
            q: [rad], float64, shape (n,).
            qd: [rad/s], shape (n,).
            current: [A], shape (n,).
            dt: time since the last sample [s] (default: the training's interval).

        Raises:
            ValueError: wrong shapes or numbers that are not finite.
        """
