"""The registry of detection methods by name.

A method's module is imported on first use, because some need scikit-learn, whose import takes
longer than the detection in a log.
"""

from __future__ import annotations

import difflib
import importlib
import os
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from tauguard.findings import ArgumentError

if TYPE_CHECKING:
    from tauguard.detectors.scores.method import Method


def _score(module: str, maker: str) -> Any:
    return getattr(importlib.import_module(f"tauguard.detectors.scores.{module}"), maker)()


#: Functions that make the default settings of each method, in the order of reports.
DETECTORS: dict[str, Callable[[], Method]] = {
    "srq-svr": partial(_score, "windowed", "SrqSvr"),
    "srq-svr-plain": partial(_score, "windowed", "PlainSrqSvr"),
    "current-network": partial(_score, "currents", "CurrentNetwork"),
    "residual-thresholds": partial(_score, "baselines", "ResidualThresholds"),
    "moving-thresholds": partial(_score, "baselines", "MovingThresholds"),
    "free-motion": partial(_score, "free_motion", "FreeMotion"),
}

#: Modules of the classes that are allowed in model files, by class name.
FILE_TYPES: dict[str, str] = {
    name: f"tauguard.{module}"
    for module, names in {
        "detectors.alarms.alarm": "CollisionAlarm",
        "detectors.alarms.beside_free_motion": "BesideFreeMotion",
        "detectors.calibration.recording": "LoadDeviation",
        "detectors.dynamics.friction": "FrictionModel",
        "detectors.dynamics.robot": "RobotNumbers",
        "detectors.estimation.estimator": "ArmModel",
        "detectors.estimation.noise_model": "NoiseModel",
        "detectors.estimation.velocity": "SensorNoise",
        "detectors.faults.inputs": "UsualInput",
        "detectors.features.free_bound": "Bound",
        "detectors.features.front_end": "FrontEnd Scaling",
        "detectors.features.windows": "WindowShape",
        "detectors.scores.baselines": "FittedThresholds",
        "detectors.scores.currents": "FittedCurrentNetwork Inputs",
        "detectors.scores.free_motion": "FittedFreeMotion",
        "detectors.scores.kernel": "KernelMachine",
        "detectors.scores.network": "Network",
        "detectors.scores.windowed": "FittedWindowed",
        "detectors.thresholds.free_scores": "SpeedNormalisation",
        "models.link_surface": "LinkSurface",
        "models.stored_robot": "StoredRobot",
    }.items()
    for name in names.split()
}

#: User modules that were named in this process.
_NAMED: set[str] = set()
#: Environment variable with further user modules, separated by commas.
MODULES = "TAUGUARD_DETECTORS"


def make_detector(name: str) -> Method:
    """The settings of a method by its name, or of a user's class as ``module:Class``.

    Classes of a module that is named here, or in the environment variable ``TAUGUARD_DETECTORS``,
    are also allowed in model files.

    Raises:
        ArgumentError: no such name or class; the message lists the existing names.
    """
    if ":" in name:
        return _of_another(name)
    if name not in DETECTORS:
        near = difflib.get_close_matches(name, DETECTORS, n=1)
        hint = f"did you mean {near[0]!r}? " if near else ""
        raise ArgumentError(
            f"no detector {name!r}: {hint}there are {', '.join(DETECTORS)}, and module:Class"
        )
    return DETECTORS[name]()


def _of_another(name: str) -> Method:
    module, _, attribute = name.partition(":")
    admit(module)
    try:
        made: Any = getattr(importlib.import_module(module), attribute)()
    except AttributeError:
        raise ArgumentError(f"detector {name!r}: {module} has no {attribute}") from None
    except TypeError as error:
        raise ArgumentError(
            f"detector {name!r}: cannot be made without arguments ({error})"
        ) from None
    if not (callable(getattr(made, "fit", None)) and isinstance(getattr(made, "name", None), str)):
        raise ArgumentError(
            f"detector {name!r}: expected a class with `name` and `fit(traces, arm)`"
        )
    found: Method = made
    return found


def admit(module: str) -> None:
    """Allow classes of a user's module in model files.

    Raises:
        ArgumentError: it cannot be imported.
    """
    try:
        importlib.import_module(module)
    except ImportError as error:
        raise ArgumentError(
            f"detector of {module!r}: it cannot be imported ({error}); install it, or name its "
            "folder in PYTHONPATH"
        ) from None
    _NAMED.add(module)


def file_type(name: str) -> type:
    """The class with this name in a model file.

    Raises:
        ArgumentError: neither a class of tauguard nor of a module that the user has named.
    """
    if name in FILE_TYPES:
        ours: type = getattr(importlib.import_module(FILE_TYPES[name]), name)
        return ours
    module, _, own = name.partition(":")
    if module in os.environ.get(MODULES, "").split(","):
        admit(module)
    if module not in _NAMED:
        raise ArgumentError(
            f"holds a {name}, which is not of tauguard: if you trust its module, name it in the "
            f"environment, export {MODULES}={module}"
        )
    kind = getattr(importlib.import_module(module), own, None)
    if not isinstance(kind, type):
        raise ArgumentError(f"holds a {name}, which {module} does not have")
    return kind
