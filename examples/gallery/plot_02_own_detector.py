"""
A detector of your own
======================

A detector has a name and ``fit``, which returns an object that gives a score for each sample.
Thresholds, alarms and metrics are the same for all detectors, so yours can be compared with the
built-in ones.
"""

from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np

import tauguard
from tauguard.datasets import free_episodes, struck_episodes
from tauguard.envs import simulate


@dataclass(frozen=True)
class ResidualChange:
    """The largest change of the residual within 20 ms."""

    name: str = "residual-change"

    def fit(self, traces, arm):
        return Fitted(self.name, arm, traces[0].dt)


@dataclass(frozen=True)
class Fitted:
    name: str
    arm: object
    dt: float
    settle: float = 0.1  # seconds until the scores count

    def scores(self, trace):
        residual, span = tauguard.residual(trace), round(0.02 / trace.dt)
        before = np.concatenate([np.repeat(residual[:1], span, axis=0), residual[:-span]])
        return np.abs(residual - before).max(axis=1)

    def stream(self):
        raise NotImplementedError("batch only")


speeds = (30.0,)
motion = tauguard.simulated(
    simulate(e) for e in struck_episodes(1, 1, 5, speeds) + free_episodes(1, 4, 12.0, speeds)
)
fresh = tauguard.simulated(simulate(e) for e in struck_episodes(2, 1, 8, speeds))
trace = fresh.traces[0]
for method in (ResidualChange(), "moving-thresholds"):
    detector = tauguard.train(motion, method=method, false_alarms_per_hour=10)
    metrics = tauguard.evaluate(detector, fresh).metrics
    part, delay = metrics["sensitivity"], metrics["delay_ms"]["median"]
    print(f"{detector.method:<17} found {part['value']:.0%} of {part['n']}, median {delay:.0f} ms")
    score = detector.detect(trace).signals.score
    plt.plot(trace.t, score / detector.threshold, linewidth=0.7, label=detector.method)
for hit in trace.truth.collisions:
    plt.axvspan(hit.onset, hit.end, color="tab:red", alpha=0.4)
plt.axhline(1.0, color="black", linewidth=0.8)
plt.ylim(0, 8)
plt.xlim(3, 12)
plt.xlabel("time [s]")
plt.ylabel("score over threshold")
plt.legend()
