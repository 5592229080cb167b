"""tauguard: simulation and detection of collisions of robot arms, with MuJoCo.

Import the sub-package that you need: ``models``, ``traces``, ``geometry``, ``cloth``, ``rigid``,
``detectors``, ``contacts``, ``envs``, ``datasets``, ``live``, ``replay``, ``report``,
``hard_cases``, ``twin``, ``benchmark``, ``speed``. ``cloth`` and ``rigid`` load neither MuJoCo nor
Pinocchio.

After ``import tauguard``, ``gymnasium.make("tauguard/Reach-v0")`` makes an environment. The others
are ``React-v1``, ``ClothReach-v1`` and ``TwoArms-v1``. ``help(env.unwrapped)`` describes an
environment.

``tauguard.residual(trace)`` and ``tauguard.plot(trace)`` help to inspect a recording by hand.

tauguard is a research tool, not a certified safety function.
"""

import importlib
from importlib.metadata import version
from typing import Any

from tauguard.environments import register_environments
from tauguard.lazy import on_demand

__version__ = version("tauguard")

register_environments()

#: Packages that are loaded at their first use.
_PACKAGES = (
    "benchmark", "cloth", "contacts", "datasets", "detectors", "envs", "geometry", "hard_cases",
    "live", "models", "replay", "report", "rigid", "speed", "traces", "twin",
)  # fmt: skip
_function, _, __all__ = on_demand(
    __name__,
    {
        "datasets.arm_logs": "read_log read_logs simulated",
        "detectors.arm_calibration": "Calibration calibrate",
        "detectors.calibration.nominal": "residual",
        "detectors.detection": "LogDetection",
        "detectors.detector": "Detector load_detector",
        "detectors.evaluating": "Evaluation evaluate",
        "detectors.training": "detect_after_quiet train",
        "findings": "ArgumentError FileError Finding Findings LogError MismatchError "
        "ModelFileError RefusedError TauguardError",
        "live.listening": "Listening listen",
        "replay.plot": "plot",
        "speed.limits": "speed_limits",
        "traces.loads": "Load",
        "traces.logs": "Log Logs",
        "twin.of_logs": "TwinOfLogs identify_twin",
    },
)


def __getattr__(name: str) -> Any:
    """Load a package, or a public name of this module."""
    if name in _PACKAGES:
        return importlib.import_module(f"tauguard.{name}")
    return _function(name)


def __dir__() -> list[str]:
    """All public names, loaded or not."""
    return sorted({"__version__", "environments", *_PACKAGES, *__all__})
