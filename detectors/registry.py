"""The registry of detection methods: a name, and what makes its settings with their defaults."""

from __future__ import annotations

import difflib
import importlib
from collections.abc import Callable
from typing import Any

from tauguard.detectors.alarms.alarm import CollisionAlarm
from tauguard.detectors.alarms.beside_free_motion import BesideFreeMotion
from tauguard.detectors.calibration.recording import LoadDeviation
from tauguard.detectors.dynamics.friction import FrictionModel
from tauguard.detectors.dynamics.robot import RobotNumbers
from tauguard.detectors.estimation.estimator import ArmModel
from tauguard.detectors.estimation.noise_model import NoiseModel
from tauguard.detectors.estimation.velocity import SensorNoise
from tauguard.detectors.faults.inputs import UsualInput
from tauguard.detectors.features.free_bound import Bound
from tauguard.detectors.features.front_end import FrontEnd, Scaling
from tauguard.detectors.features.windows import WindowShape
from tauguard.detectors.scores.baselines import (
    Cusum,
    FittedCusum,
    FittedThresholds,
    MovingThresholds,
    ResidualThresholds,
)
from tauguard.detectors.scores.currents import (
    CurrentNetwork,
    CurrentThreshold,
    FittedCurrentNetwork,
    FittedCurrentThreshold,
    Inputs,
)
from tauguard.detectors.scores.detector import Detector
from tauguard.detectors.scores.free_motion import FittedFreeMotion, FreeMotion
from tauguard.detectors.scores.kernel import KernelMachine
from tauguard.detectors.scores.learned import (
    Boosting,
    OneOutput,
    PlainSrqSvr,
    SrqSvr,
    WindowNetwork,
)
from tauguard.detectors.scores.regressors import Forest, Network
from tauguard.detectors.scores.windowed import FittedWindowed
from tauguard.detectors.thresholds.speed_normalisation import SpeedNormalisation

#: Every method, in the order that reports show them.
DETECTORS: dict[str, Callable[[], Detector]] = {
    "srq-svr": SrqSvr,
    "srq-svr-plain": PlainSrqSvr,
    "current-network": CurrentNetwork,
    "current-network-static": CurrentNetwork.static,
    "current-threshold": CurrentThreshold,
    "residual-thresholds": ResidualThresholds,
    "moving-thresholds": MovingThresholds,
    "cusum": Cusum,
    "window-network": WindowNetwork,
    "boosting": Boosting,
    "free-motion": FreeMotion,
}

#: Classes that a model file may hold, by their names there.
FILE_TYPES: dict[str, type] = {
    kind.__qualname__: kind
    for kind in (
        ArmModel,
        BesideFreeMotion,
        Bound,
        CollisionAlarm,
        NoiseModel,
        FittedCurrentNetwork,
        FittedCurrentThreshold,
        FittedCusum,
        FittedFreeMotion,
        FittedThresholds,
        FittedWindowed,
        Forest,
        FrictionModel,
        FrontEnd,
        Inputs,
        KernelMachine,
        LoadDeviation,
        Network,
        OneOutput,
        RobotNumbers,
        Scaling,
        SensorNoise,
        SpeedNormalisation,
        UsualInput,
        WindowShape,
    )
}

#: Modules of others that the user has named in this process.
_NAMED: set[str] = set()


def make_detector(name: str) -> Detector:
    """The settings of a method by its name, or of another's class as ``module:Class``.

    A module that is named here may also be loaded from model files.

    Raises:
        ValueError: no such name or class; the message lists the names that there are.
    """
    if ":" in name:
        return _of_another(name)
    if name not in DETECTORS:
        near = difflib.get_close_matches(name, DETECTORS, n=1)
        hint = f"did you mean {near[0]!r}? " if near else ""
        raise ValueError(
            f"no detector {name!r}: {hint}there are {', '.join(DETECTORS)}, and module:Class"
        )
    return DETECTORS[name]()


def _of_another(name: str) -> Detector:
    module, _, attribute = name.partition(":")
    admit(module)
    try:
        made: Any = getattr(importlib.import_module(module), attribute)()
    except AttributeError:
        raise ValueError(f"detector {name!r}: {module} has no {attribute}") from None
    if not (callable(getattr(made, "fit", None)) and isinstance(getattr(made, "name", None), str)):
        raise ValueError(f"detector {name!r}: expected a class with `name` and `fit(traces, arm)`")
    found: Detector = made
    return found


def admit(module: str) -> None:
    """Allow model files to build classes of a module of others.

    Raises:
        ValueError: it cannot be imported.
    """
    try:
        importlib.import_module(module)
    except ImportError as error:
        raise ValueError(
            f"detector of {module!r}: it cannot be imported ({error}); install it, or name its "
            "folder in PYTHONPATH"
        ) from None
    _NAMED.add(module)


def file_type(name: str) -> type:
    """The class that a model file calls ``name``.

    Raises:
        ValueError: not one of ours, nor of a module that was named in this process.
    """
    if name in FILE_TYPES:
        return FILE_TYPES[name]
    module, _, own = name.partition(":")
    if module not in _NAMED:
        raise ValueError(
            f"holds a {name}, which is not of tauguard: name its module by --detector "
            f"{module}:CLASS, or call tauguard.detectors.registry.admit({module!r}) first"
        )
    kind = getattr(importlib.import_module(module), own, None)
    if not isinstance(kind, type):
        raise ValueError(f"holds a {name}, which {module} does not have")
    return kind
