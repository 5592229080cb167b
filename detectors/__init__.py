"""Momentum observer, features, collision detectors, event matching and metrics."""

from tauguard.detectors.after_alarm.diagnosis import Diagnoser, Diagnosis, diagnose
from tauguard.detectors.after_alarm.diagnosis_metrics import diagnosis_figures, judge_diagnoses
from tauguard.detectors.calibrate import Calibration, Priors, calibrate
from tauguard.detectors.conformal import (
    EpisodeLevels,
    Promise,
    calibrate_threshold,
    promised,
)
from tauguard.detectors.detector import Detector
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
from tauguard.detectors.thresholded import Thresholded
from tauguard.detectors.thresholds import QuietDetector, QuietThresholds
from tauguard.detectors.zoo.file import load_model, save_model
from tauguard.detectors.zoo.table import DETECTORS, make_detector

__all__ = [
    "DETECTORS",
    "ArmModel",
    "Calibration",
    "CollisionDetector",
    "Confirmation",
    "Detector",
    "DetectorSettings",
    "Diagnoser",
    "Diagnosis",
    "EpisodeLevels",
    "Estimate",
    "Estimator",
    "FrictionModel",
    "Matching",
    "MomentumObserver",
    "Priors",
    "Promise",
    "QuietDetector",
    "QuietThresholds",
    "RobotNumbers",
    "SrqSVR",
    "Thresholded",
    "Unknowns",
    "calibrate",
    "calibrate_threshold",
    "confirmed",
    "diagnose",
    "diagnosis_figures",
    "figures",
    "find_alarms",
    "gravity_torque",
    "inverse_dynamics",
    "judge",
    "judge_diagnoses",
    "load_model",
    "make_detector",
    "mass_matrix",
    "match",
    "momentum_regressor",
    "momentum_terms",
    "observe",
    "poisson_rate",
    "promised",
    "save_model",
    "srq_kernel",
    "wilson",
]
