"""Any detector of the table with its threshold as a file, read and written by skops."""

from __future__ import annotations

import os
from typing import Any, Protocol

from tauguard.detectors.detector import Detector
from tauguard.detectors.methods.srq_svr import SvrDetector
from tauguard.detectors.model_file import ANEW, read_archive, rebuilt, write_archive
from tauguard.detectors.model_file import FORMAT as CHAIN_FORMAT
from tauguard.detectors.model_file import RANKING as FORMAT
from tauguard.detectors.registry import make_detector
from tauguard.detectors.thresholds.speed_levels import Levelled, SpeedLevels
from tauguard.detectors.thresholds.thresholded import Thresholded


class Storable(Detector, Protocol):
    """A detector that can be taken apart into plain values and arrays."""

    def parts(self) -> dict[str, Any]:
        """What a model file keeps."""

    @classmethod
    def from_parts(cls, parts: dict[str, Any]) -> Detector:
        """The detector again from :meth:`parts`."""


def save_model(watched: Thresholded, path: str | os.PathLike[str]) -> None:
    """Write a fitted detector with its threshold; whole or not at all.

    Raises:
        ValueError: it is not fitted, or the folder cannot be written.
    """
    own = watched.detector
    # The form that all commands and the environments read, where it can hold the detector.
    if (
        isinstance(own, SvrDetector)
        and own.name == "srq-svr"
        and own.chain.settings.confirmation == watched.confirmation
    ):
        own.chain.at(watched.threshold, watched.confirmation).save(path)
        return
    levels = own.levels if isinstance(own, Levelled) else None
    detector: Storable = own.detector if isinstance(own, Levelled) else own  # type: ignore[assignment]
    content = {
        "format": FORMAT,
        "detector": detector.name,
        "threshold": float(watched.threshold),
        "confirmation": float(watched.confirmation),
        "parts": detector.parts(),
        "levels": vars(levels) if levels else {},
    }
    write_archive(path, content)


def load_model(path: str | os.PathLike[str]) -> Thresholded:
    """Read a model file: of :func:`save_model`, or of ``CollisionDetector.save``.

    Raises:
        ValueError: missing, truncated or of another kind, or holding types that a detector does
            not need (nothing of them is built).
    """
    content = read_archive(path)
    if content.get("format") not in (FORMAT, CHAIN_FORMAT):
        raise ValueError(f"{path}: not a detector file of this version ({FORMAT!r}); {ANEW}")
    try:
        if content["format"] == CHAIN_FORMAT:
            chain = rebuilt(content)
            return Thresholded(SvrDetector(chain), chain.threshold, chain.settings.confirmation)
        kind: type[Storable] = type(make_detector(content["detector"]))  # type: ignore[assignment]
        detector = kind.from_parts(content["parts"])
        if content["levels"]:
            detector = Levelled(detector, SpeedLevels(**content["levels"]))
        return Thresholded(detector, float(content["threshold"]), float(content["confirmation"]))
    except (KeyError, TypeError, AttributeError, IndexError, ValueError) as error:
        raise ValueError(f"{path}: a detector file with a part missing ({error})") from None
