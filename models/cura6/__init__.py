"""The CURA6-like arm: six revolute joints, the class of a 10 kg cobot."""

from importlib.resources import files

from tauguard.models.cura6.design import FLANGE, HOME, JOINTS, MAX_ACCELERATION, MAX_SPEED

__all__ = ["FLANGE", "HOME", "JOINTS", "MAX_ACCELERATION", "MAX_SPEED", "arm_xml"]


def arm_xml() -> str:
    """MJCF text of the arm alone, self-contained."""
    return files(__name__).joinpath("cura6.xml").read_text()
