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
from typing import TYPE_CHECKING, Any

from tauguard.environments import register_environments

if TYPE_CHECKING:
    from tauguard.datasets.arm_logs import read_log, read_logs, simulated
    from tauguard.detectors.arm_calibration import Calibration, calibrate
    from tauguard.detectors.calibration.nominal import residual
    from tauguard.detectors.detection import LogDetection
    from tauguard.detectors.detector import Detector, load_detector
    from tauguard.detectors.evaluating import Evaluation, evaluate
    from tauguard.detectors.training import detect_after_quiet, train
    from tauguard.replay.plot import plot
    from tauguard.speed.limits import speed_limits
    from tauguard.traces.loads import Load
    from tauguard.traces.logs import Log, Logs
    from tauguard.twin.of_logs import TwinOfLogs, identify_twin

__all__ = [
    "Calibration", "Detector", "Evaluation", "Load", "Log", "LogDetection", "Logs", "TwinOfLogs",
    "calibrate", "detect_after_quiet", "evaluate", "identify_twin", "load_detector", "plot",
    "read_log", "read_logs", "residual", "simulated", "speed_limits", "train",
]  # fmt: skip
__version__ = version("tauguard")

register_environments()

#: Packages that are loaded at their first use.
_PACKAGES = (
    "benchmark", "cloth", "contacts", "datasets", "detectors", "envs", "geometry", "hard_cases",
    "live", "models", "replay", "report", "rigid", "speed", "traces", "twin",
)  # fmt: skip
_FUNCTIONS = {
    **dict.fromkeys(("read_log", "read_logs", "simulated"), "tauguard.datasets.arm_logs"),
    "Load": "tauguard.traces.loads",
    **dict.fromkeys(("Log", "Logs"), "tauguard.traces.logs"),
    **dict.fromkeys(("Calibration", "calibrate"), "tauguard.detectors.arm_calibration"),
    **dict.fromkeys(("Detector", "load_detector"), "tauguard.detectors.detector"),
    **dict.fromkeys(("Evaluation", "evaluate"), "tauguard.detectors.evaluating"),
    **dict.fromkeys(("detect_after_quiet", "train"), "tauguard.detectors.training"),
    **dict.fromkeys(("TwinOfLogs", "identify_twin"), "tauguard.twin.of_logs"),
    "LogDetection": "tauguard.detectors.detection",
    "plot": "tauguard.replay.plot",
    "residual": "tauguard.detectors.calibration.nominal",
    "speed_limits": "tauguard.speed.limits",
}


def __getattr__(name: str) -> Any:
    """Load a package, or a public function of this module."""
    if name in _PACKAGES:
        return importlib.import_module(f"tauguard.{name}")
    if name in _FUNCTIONS:
        return getattr(importlib.import_module(_FUNCTIONS[name]), name)
    raise AttributeError(f"module 'tauguard' has no attribute {name!r}")


def __dir__() -> list[str]:
    """All public names, loaded or not."""
    return sorted({"__version__", "environments", *_PACKAGES, *_FUNCTIONS})
