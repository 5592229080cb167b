"""Momentum observer, features, collision detectors, event matching and metrics."""

from typing import TYPE_CHECKING

from tauguard.lazy import on_demand

if TYPE_CHECKING:
    from tauguard.detectors.calibration.calibrate import Calibration, Priors, calibrate
    from tauguard.detectors.detector import Detector
    from tauguard.detectors.diagnosis.diagnosis import Diagnoser, Diagnosis, diagnose
    from tauguard.detectors.diagnosis.diagnosis_metrics import diagnosis_figures, judge_diagnoses
    from tauguard.detectors.dynamics.friction import FrictionModel
    from tauguard.detectors.dynamics.robot import (
        RobotNumbers,
        gravity_torque,
        inverse_dynamics,
        mass_matrix,
        momentum_regressor,
        momentum_terms,
    )
    from tauguard.detectors.estimation.estimator import ArmModel, Estimate, Estimator, Unknowns
    from tauguard.detectors.estimation.observer import MomentumObserver, observe
    from tauguard.detectors.evaluation.events import Matching, find_alarms, judge, match
    from tauguard.detectors.evaluation.metrics import figures, poisson_rate
    from tauguard.detectors.methods.pipeline import CollisionDetector, DetectorSettings
    from tauguard.detectors.methods.svr_regressor import SrqSVR, srq_kernel
    from tauguard.detectors.ranking_file import load_model, save_model
    from tauguard.detectors.registry import DETECTORS, make_detector
    from tauguard.detectors.thresholds.confirmation import Confirmation, confirmed
    from tauguard.detectors.thresholds.conformal import (
        EpisodeLevels,
        Promise,
        calibrate_threshold,
        promised,
    )
    from tauguard.detectors.thresholds.quiet import QuietDetector, QuietThresholds
    from tauguard.detectors.thresholds.thresholded import Thresholded
    from tauguard.report import rate as wilson

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

__getattr__ = on_demand(__name__)
