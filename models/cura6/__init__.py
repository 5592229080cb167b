"""The CURA6-like arm (six revolute joints, in the class of 10 kg cobots) and its other sizes."""

from functools import cache
from importlib.resources import files

from tauguard.models.cura6.design import (
    FLANGE,
    HOME,
    JOINTS,
    MAX_ACCELERATION,
    MAX_SPEED,
    SIZES,
    flange,
    links,
    mjcf,
)

__all__ = [
    "FLANGE", "HOME", "JOINTS", "MAX_ACCELERATION", "MAX_SPEED", "NAMES", "SIZES", "arm_xml",
    "max_speed",
]  # fmt: skip

#: The arm and its other sizes, by name.
NAMES = ("cura6", *SIZES)


@cache
def arm_xml(name: str = "cura6") -> str:
    """MJCF text of the arm alone, self-contained; ``name`` is one of :data:`NAMES`."""
    if name in SIZES:
        return mjcf(links(SIZES[name]), flange(SIZES[name]), name)
    return files(__name__).joinpath("cura6.xml").read_text("utf-8")


def max_speed(name: str = "cura6") -> tuple[float, ...]:
    """Largest joint speeds of planned motions [rad/s]."""
    factor = SIZES[name].speed if name in SIZES else 1.0
    return tuple(factor * speed for speed in MAX_SPEED)
