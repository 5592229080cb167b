"""A detector as a file: arrays and scikit-learn's own types, so that skops distrusts nothing."""

from __future__ import annotations

import os
import zipfile
import zlib
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np
import skops.io
from sklearn.svm import SVR

from tauguard.detectors.estimator import ArmModel
from tauguard.detectors.features import Envelope, Features, WindowShape
from tauguard.detectors.friction import FrictionModel
from tauguard.detectors.numbers import RobotNumbers
from tauguard.detectors.pipeline import CollisionDetector, DetectorSettings
from tauguard.detectors.svr import SrqSVR
from tauguard.detectors.velocity import SensorNoise

FORMAT = "tauguard detector 1"
#: What reading a damaged archive may raise, by where it is damaged.
_DAMAGE = (
    zipfile.BadZipFile,
    zlib.error,
    KeyError,
    ValueError,
    TypeError,
    AttributeError,
    EOFError,
    OSError,
)


def _plain(value: object) -> dict[str, Any]:
    """The fields of a dataclass as they are."""
    return {field.name: getattr(value, field.name) for field in fields(value)}  # type: ignore[arg-type]


def save_detector(detector: CollisionDetector, path: str | os.PathLike[str]) -> None:
    """Write a fitted detector; whole or not at all.

    Raises:
        ValueError: it is not fitted, or the folder cannot be written.
    """
    arm, features, regressor = detector._fitted()
    content = {
        "format": FORMAT,
        "settings": asdict(detector.settings),
        "threshold": float(detector.threshold),
        "dt": float(detector.dt),
        "robot": _plain(arm.robot),
        "drive_gain": arm.drive_gain,
        "noise": arm.noise,
        "friction": _plain(arm.friction) if arm.friction else None,
        "sensors": _plain(arm.sensors) if arm.sensors else None,
        "features": _plain(features)
        | {
            "shape": _plain(features.shape),
            "envelope": features.envelope.weights if features.envelope else None,
        },
        "svr": regressor.svr_,
        "vectors": regressor.support_vectors_,
    }
    target = Path(path)
    part = target.with_name(target.name + ".part")
    try:
        with open(part, "wb") as file:
            file.write(skops.io.dumps(content))
        os.replace(part, target)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise ValueError(f"{target}: cannot be written ({error.strerror})") from None


def load_detector(path: str | os.PathLike[str]) -> CollisionDetector:
    """Read what :func:`save_detector` wrote.

    Raises:
        ValueError: missing, truncated or of another kind, or holding types that a detector does
            not need (nothing of them is built).
    """
    target = Path(path)
    try:
        data = target.read_bytes()
    except OSError as error:
        raise ValueError(f"{target}: cannot be read ({error.strerror})") from None
    try:
        strangers = skops.io.get_untrusted_types(data=data)
        content = None if strangers else skops.io.loads(data, trusted=[])
    except _DAMAGE as error:
        raise ValueError(
            f"{target}: not a detector file, or a damaged one ({type(error).__name__})"
        ) from None
    if strangers:
        raise ValueError(f"{target}: holds types not to be trusted: {', '.join(strangers)}")
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise ValueError(f"{target}: not a detector file of this version ({FORMAT!r})")
    try:
        return _rebuilt(content)
    except (KeyError, TypeError, AttributeError, IndexError, ValueError) as error:
        raise ValueError(f"{target}: a detector file with a part missing ({error})") from None


def _rebuilt(content: dict[str, Any]) -> CollisionDetector:
    settings = content["settings"]
    for name in ("joints", "reference"):
        settings[name] = tuple(settings[name])
    detector = CollisionDetector(DetectorSettings(**settings))
    friction = content["friction"]
    detector.arm = ArmModel(
        RobotNumbers(**{**content["robot"], "joint_names": tuple(content["robot"]["joint_names"])}),
        content["drive_gain"],
        FrictionModel(**friction) if friction else None,
        content["noise"],
        SensorNoise(**content["sensors"]) if content.get("sensors") else None,
    )
    parts = content["features"]
    envelope = parts["envelope"]
    detector.features = Features(
        tuple(int(j) for j in parts["joints"]),
        WindowShape(**parts["shape"]),
        None if envelope is None else Envelope(np.asarray(envelope)),
        float(parts["factor"]),
        float(parts["units"]),
        bool(parts["compress"]),
        tuple(parts["notes"]),
    )
    svr, vectors = content["svr"], np.asarray(content["vectors"], dtype=np.float64)
    if not isinstance(svr, SVR) or vectors.shape != (len(svr.support_), detector.features.size):
        raise KeyError("regressor")
    detector.regressor = SrqSVR.restored(svr, vectors, detector.settings.sigma)
    detector.threshold, detector.dt = float(content["threshold"]), float(content["dt"])
    return detector
