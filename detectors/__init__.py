"""Momentum observer, collision detectors, diagnosis of collisions, and metrics."""

from typing import TYPE_CHECKING

from tauguard.lazy import on_demand

if TYPE_CHECKING:
    from tauguard.detectors.alarms.alarm import AlarmStream, CollisionAlarm
    from tauguard.detectors.alarms.training import held_out, train, with_guarantee, with_rate
    from tauguard.detectors.calibration.calibrate import Calibration, Priors, calibrate
    from tauguard.detectors.diagnosis.diagnosis import Diagnoser, Diagnosis, diagnose
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
    from tauguard.detectors.evaluation.diagnosis_metrics import diagnosis_metrics, match_diagnoses
    from tauguard.detectors.evaluation.matching import (
        Matching,
        detection_metrics,
        match,
        match_detection,
        matchings,
    )
    from tauguard.detectors.events import confirmed, find_alarms
    from tauguard.detectors.model_file import load_model, save_model
    from tauguard.detectors.registry import DETECTORS, make_detector
    from tauguard.detectors.scores.detector import Detector, FittedDetector, ScoreStream
    from tauguard.detectors.scores.kernel import SrqRegressor, srq_kernel
    from tauguard.detectors.scores.windowed import PlainSrqSvr, SrqSvr
    from tauguard.detectors.thresholds.free_scores import FreeScores, SpeedNormalisation
    from tauguard.detectors.thresholds.guarantee import Guarantee, guaranteed_threshold
    from tauguard.report import poisson_rate
    from tauguard.report import rate as wilson

__all__ = [
    "DETECTORS", "AlarmStream", "ArmModel", "Calibration", "CollisionAlarm", "Detector",
    "Diagnoser", "Diagnosis", "Estimate", "Estimator", "FittedDetector", "FreeScores",
    "FrictionModel", "Guarantee", "Matching", "MomentumObserver", "PlainSrqSvr", "Priors",
    "RobotNumbers", "ScoreStream", "SpeedNormalisation", "SrqRegressor", "SrqSvr", "Unknowns",
    "calibrate", "confirmed", "detection_metrics", "diagnose", "diagnosis_metrics", "find_alarms",
    "gravity_torque", "guaranteed_threshold", "held_out", "inverse_dynamics", "load_model",
    "make_detector", "mass_matrix", "match", "match_detection", "match_diagnoses", "matchings",
    "momentum_regressor", "momentum_terms", "observe", "poisson_rate", "save_model", "srq_kernel",
    "train", "wilson", "with_guarantee", "with_rate",
]  # fmt: skip

__getattr__ = on_demand(__name__)
