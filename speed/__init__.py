"""How fast a robot may move beside a person: permissible speed along a program.

The method is power and force limiting: an impact and the force that follows it must stay within the
limits of the body region (ISO/TS 15066:2016, annex A). The results are estimates for comparing
programs, tools and detectors. They do not replace a measurement on the robot.
"""

from tauguard.speed.limits import SpeedLimits, speed_limits
from tauguard.speed.program import Program, read_waypoints
from tauguard.speed.reaction import Stop
from tauguard.speed.search import SpeedLimit, SpeedOptions
from tauguard.speed.tool import Cover, Tool

__all__ = [
    "Cover", "Program", "SpeedLimit", "SpeedLimits", "SpeedOptions", "Stop", "Tool",
    "read_waypoints", "speed_limits",
]  # fmt: skip
