"""A detector as a file: arrays and scikit-learn's own types, so that skops distrusts nothing."""

from __future__ import annotations

import os
import zipfile
import zlib
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import skops.io
from sklearn.svm import SVR

from tauguard.detectors.features.windows import Envelope, Features, WindowShape
from tauguard.detectors.methods.pipeline import CollisionDetector, DetectorSettings
from tauguard.detectors.methods.svr_regressor import SrqSVR
from tauguard.detectors.model_parts import arm_from_parts, arm_parts, plain

FORMAT = "tauguard detector 1"
#: Of :mod:`tauguard.detectors.ranking_file`: any other detector, with its threshold.
RANKING = "tauguard ranking detector 2"
#: What another kind of detector is told where samples come one at a time.
_WHOLE = (
    "which watches whole recordings only (`tauguard detect`); expected one that takes one sample "
    "at a time, as environments do: srq-svr, which `tauguard train --traces` writes without "
    "--levelled"
)
#: What a file of another format or version is told.
ANEW = "train the detector anew by `tauguard train --traces`"
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


def save_detector(detector: CollisionDetector, path: str | os.PathLike[str]) -> None:
    """Write a fitted detector; whole or not at all.

    Raises:
        ValueError: it is not fitted, or the folder cannot be written.
    """
    write_archive(path, detector_parts(detector))


def detector_parts(detector: CollisionDetector) -> dict[str, Any]:
    """A fitted detector as a dictionary of arrays, plain values and an SVR."""
    arm, features, regressor = detector._fitted()
    return {
        "format": FORMAT,
        "settings": asdict(detector.settings),
        "threshold": float(detector.threshold),
        "dt": float(detector.dt),
        **arm_parts(arm),
        "features": plain(features)
        | {
            "shape": plain(features.shape),
            "envelope": features.envelope.weights if features.envelope else None,
        },
        "svr": regressor.svr_,
        "vectors": regressor.support_vectors_,
    }


def write_archive(path: str | os.PathLike[str], content: dict[str, Any]) -> None:
    """Write ``content`` by skops; whole or not at all.

    Raises:
        ValueError: the folder cannot be written.
    """
    target = Path(path)
    part = target.with_name(target.name + ".part")
    try:
        with open(part, "wb") as file:
            file.write(skops.io.dumps(content))
        os.replace(part, target)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise ValueError(f"{target}: cannot be written ({error.strerror})") from None


def read_archive(path: str | os.PathLike[str]) -> dict[str, Any]:
    """What :func:`write_archive` wrote, its ``format`` not looked at.

    Raises:
        ValueError: missing, truncated or no dictionary, or holding types that a detector does not
            need (nothing of them is built).
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
    if not isinstance(content, dict):
        raise ValueError(f"{target}: not a detector file of this version ({FORMAT!r}); {ANEW}")
    return content


def load_detector(path: str | os.PathLike[str]) -> CollisionDetector:
    """Read what :func:`save_detector` wrote.

    Raises:
        ValueError: missing, truncated or of another kind (the message says which would do), or
            holding types that a detector does not need (nothing of them is built).
    """
    from tauguard.detectors.methods.free_motion_file import is_free_motion

    if is_free_motion(path):
        raise ValueError(f"{path}: a real arm's detector (train --free), {_WHOLE}")
    content = read_archive(path)
    if content.get("format") == RANKING:
        levelled = "levelled " if content.get("levels") else ""
        raise ValueError(f"{path}: a {levelled}{content.get('detector')}, {_WHOLE}")
    if content.get("format") != FORMAT:
        raise ValueError(f"{path}: not a detector file of this version ({FORMAT!r}); {ANEW}")
    try:
        return rebuilt(content)
    except (KeyError, TypeError, AttributeError, IndexError, ValueError) as error:
        raise ValueError(f"{path}: a detector file with a part missing ({error})") from None


def rebuilt(content: dict[str, Any]) -> CollisionDetector:
    """The detector again from :func:`detector_parts`."""
    settings = content["settings"]
    for name in ("joints", "reference"):
        settings[name] = tuple(settings[name])
    detector = CollisionDetector(DetectorSettings(**settings))
    detector.arm = arm_from_parts(content)
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
