"""The table of detectors: a name, and what makes an unfitted one with its defaults."""

from __future__ import annotations

import difflib
from collections.abc import Callable

from tauguard.detectors.detector import Detector
from tauguard.detectors.methods.boosting import Boosting
from tauguard.detectors.methods.current_network import CurrentNetwork
from tauguard.detectors.methods.current_threshold import CurrentThreshold
from tauguard.detectors.methods.cusum import Cusum
from tauguard.detectors.methods.one_class import OneClass
from tauguard.detectors.methods.residual_thresholds import MovingThresholds, ResidualThresholds
from tauguard.detectors.methods.srq_svr import SvrDetector
from tauguard.detectors.methods.window_network import WindowNetwork

#: Every detector, in the order that reports show them.
DETECTORS: dict[str, Callable[[], Detector]] = {
    "srq-svr": SvrDetector,
    "srq-svr-plain": SvrDetector.plain,
    "current-network": CurrentNetwork,
    "current-network-static": CurrentNetwork.static,
    "current-threshold": CurrentThreshold,
    "residual-thresholds": ResidualThresholds,
    "moving-thresholds": MovingThresholds,
    "cusum": Cusum,
    "one-class": OneClass,
    "window-network": WindowNetwork,
    "boosting": Boosting,
}


def make_detector(name: str) -> Detector:
    """An unfitted detector by its name.

    Raises:
        ValueError: no such name; the message lists those there are.
    """
    if name not in DETECTORS:
        near = difflib.get_close_matches(name, DETECTORS, n=1)
        hint = f"did you mean {near[0]!r}? " if near else ""
        raise ValueError(f"no detector {name!r}: {hint}there are {', '.join(DETECTORS)}")
    return DETECTORS[name]()
