"""Momentum observer, features, collision detectors, event matching and metrics."""

from tauguard.detectors.events import Matching, find_alarms, judge, match
from tauguard.detectors.filter import Confirmation, confirmed
from tauguard.detectors.metrics import figures, poisson_rate, wilson
from tauguard.detectors.numbers import (
    RobotNumbers,
    gravity_torque,
    inverse_dynamics,
    mass_matrix,
    momentum_regressor,
    momentum_terms,
)
from tauguard.detectors.observer import MomentumObserver, observe

__all__ = [
    "Confirmation",
    "Matching",
    "MomentumObserver",
    "RobotNumbers",
    "confirmed",
    "figures",
    "find_alarms",
    "gravity_torque",
    "inverse_dynamics",
    "judge",
    "mass_matrix",
    "match",
    "momentum_regressor",
    "momentum_terms",
    "observe",
    "poisson_rate",
    "wilson",
]
