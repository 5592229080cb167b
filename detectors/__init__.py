"""Calibration of arms, collision detection, diagnosis of collisions, and metrics."""

from typing import TYPE_CHECKING

from tauguard.lazy import on_demand

if TYPE_CHECKING:
    from tauguard.detectors.alarms.alarm import CollisionAlarm
    from tauguard.detectors.alarms.monitor import Answer, Monitor
    from tauguard.detectors.alarms.training import with_guarantee
    from tauguard.detectors.arm_calibration import Calibration
    from tauguard.detectors.detection import LogDetection
    from tauguard.detectors.detector import Detector
    from tauguard.detectors.diagnosis.diagnosis import Diagnoser, Diagnosis, diagnose
    from tauguard.detectors.dynamics.friction import FrictionModel
    from tauguard.detectors.dynamics.robot import (
        RobotNumbers,
        gravity_torque,
        inverse_dynamics,
        mass_matrix,
    )
    from tauguard.detectors.estimation.estimator import ArmModel, Estimator
    from tauguard.detectors.estimation.observer import MomentumObserver, observe
    from tauguard.detectors.evaluating import Evaluation
    from tauguard.detectors.evaluation.card_page import ThresholdCard
    from tauguard.detectors.evaluation.diagnosis_metrics import diagnosis_metrics
    from tauguard.detectors.evaluation.matching import (
        Matching,
        detection_metrics,
        match,
        match_detection,
    )
    from tauguard.detectors.events import confirmed, find_alarms
    from tauguard.detectors.model_file import load_model, save_model
    from tauguard.detectors.registry import DETECTORS, make_detector
    from tauguard.detectors.scores.free_motion import FreeMotion
    from tauguard.detectors.scores.method import FittedMethod, Method, ScoreStream
    from tauguard.detectors.scores.windowed import SrqSvr
    from tauguard.detectors.thresholds.guarantee import Guarantee
    from tauguard.report import poisson_rate

__all__ = [
    "DETECTORS", "Answer", "ArmModel", "Calibration", "CollisionAlarm", "Detector", "Diagnoser",
    "Diagnosis", "Estimator", "Evaluation", "FittedMethod", "FreeMotion", "FrictionModel",
    "Guarantee", "LogDetection", "Matching", "Method", "MomentumObserver", "Monitor",
    "RobotNumbers", "ScoreStream", "SrqSvr", "ThresholdCard", "confirmed", "detection_metrics",
    "diagnose", "diagnosis_metrics", "find_alarms", "gravity_torque", "inverse_dynamics",
    "load_model", "make_detector", "mass_matrix", "match", "match_detection", "observe",
    "poisson_rate", "save_model", "with_guarantee",
]  # fmt: skip

__getattr__ = on_demand(__name__)
