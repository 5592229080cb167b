"""Momentum observer, features, collision detectors, event matching and metrics."""

from tauguard.detectors.observer import (
    MomentumObserver,
    RobotNumbers,
    inverse_dynamics,
    momentum_terms,
    observe,
)

__all__ = [
    "MomentumObserver",
    "RobotNumbers",
    "inverse_dynamics",
    "momentum_terms",
    "observe",
]
