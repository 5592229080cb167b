"""Calibration of arms, collision detection, diagnosis of collisions, and metrics."""

from tauguard.lazy import on_demand

__getattr__, __dir__, __all__ = on_demand(
    __name__,
    {
        "alarms.alarm": "CollisionAlarm",
        "alarms.monitor": "Answer Monitor",
        "alarms.training": "with_guarantee",
        "arm_calibration": "Calibration",
        "detection": "LogDetection",
        "detector": "Detector",
        "diagnosis.diagnosis": "Diagnoser Diagnosis diagnose",
        "dynamics.friction": "FrictionModel",
        "dynamics.robot": "RobotNumbers gravity_torque inverse_dynamics mass_matrix",
        "estimation.estimator": "ArmModel Estimator",
        "estimation.observer": "MomentumObserver observe",
        "evaluating": "Evaluation",
        "evaluation.card_page": "ThresholdCard",
        "evaluation.diagnosis_metrics": "diagnosis_metrics",
        "evaluation.matching": "Matching detection_metrics match match_detection",
        "events": "confirmed find_alarms",
        "model_file": "load_model save_model",
        "registry": "DETECTORS make_detector",
        "scores.free_motion": "FreeMotion",
        "scores.method": "FittedMethod Method ScoreStream",
        "scores.windowed": "SrqSvr",
        "thresholds.guarantee": "Guarantee",
        "tauguard.report": "poisson_rate",
    },
)
