"""What is simulated: the arm, its drive train, obstacles and the scene composer."""

from tauguard.models import cura6
from tauguard.models.drive import Drive, Friction, Ripple, Sensors, cura6_drive
from tauguard.models.mismatch import Mismatch
from tauguard.models.nominal import add_payload, compiled, pin_model
from tauguard.models.scene import (
    Clamp,
    Scene,
    SceneSpec,
    Striker,
    compose,
    set_payload,
)

__all__ = [
    "Clamp",
    "Drive",
    "Friction",
    "Mismatch",
    "Ripple",
    "Scene",
    "SceneSpec",
    "Sensors",
    "Striker",
    "add_payload",
    "compiled",
    "compose",
    "cura6",
    "cura6_drive",
    "pin_model",
    "set_payload",
]
