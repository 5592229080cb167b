"""Momentum observer, features, collision detectors, event matching and metrics."""

from tauguard.detectors.calibrate import Calibration, Priors, calibrate
from tauguard.detectors.estimator import ArmModel, Estimate, Estimator, Unknowns
from tauguard.detectors.events import Matching, find_alarms, judge, match
from tauguard.detectors.filter import Confirmation, confirmed
from tauguard.detectors.friction import FrictionModel
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
from tauguard.detectors.pipeline import CollisionDetector, DetectorSettings
from tauguard.detectors.svr import SrqSVR, srq_kernel
from tauguard.detectors.thresholds import QuietDetector, QuietThresholds

__all__ = [
    "ArmModel",
    "Calibration",
    "CollisionDetector",
    "Confirmation",
    "DetectorSettings",
    "Estimate",
    "Estimator",
    "FrictionModel",
    "Matching",
    "MomentumObserver",
    "Priors",
    "QuietDetector",
    "QuietThresholds",
    "RobotNumbers",
    "SrqSVR",
    "Unknowns",
    "calibrate",
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
    "srq_kernel",
    "wilson",
]
