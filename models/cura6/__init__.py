"""The CURA6-like arm (six revolute joints, in the class of 10 kg cobots) and its other sizes."""

from functools import cache
from importlib.resources import files

#: The arm and its other sizes: factors on the drives (torques, gains, friction) and joint speeds.
SIZES = {
    "cura6": (1.0, 1.0),
    "cura6-small": (0.5, 1.0),
    "cura6-long": (1.4, 0.85),
    "cura6-strong": (1.6, 1.0),
}
NAMES = tuple(SIZES)
JOINTS = tuple(f"joint{i}" for i in range(1, 7))
#: Home pose [rad]: elbow up, tool axis down.
HOME = (0.0, -0.5, 1.9, 0.1708, -1.5708, 0.0)
#: Largest joint speeds and accelerations of planned motions [rad/s, rad/s^2].
MAX_SPEED = (2.0944, 2.0944, 3.1416, 3.1416, 3.1416, 3.1416)
MAX_ACCELERATION = (8.0, 8.0, 12.0, 16.0, 16.0, 16.0)


@cache
def arm_xml(name: str = "cura6") -> str:
    """MJCF text of the arm alone, self-contained; ``name`` is one of :data:`NAMES`."""
    return files(__name__).joinpath(f"{name}.xml").read_text("utf-8")


def max_speed(name: str = "cura6") -> tuple[float, ...]:
    """Largest joint speeds of planned motions [rad/s]."""
    return tuple(SIZES[name][1] * speed for speed in MAX_SPEED)
