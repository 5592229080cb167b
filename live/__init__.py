"""Live robot streams (RTDE, ROS 2, lines of text, a replayed log), and a server for tests."""

from tauguard.lazy import on_demand

__getattr__, __dir__, __all__ = on_demand(
    __name__,
    {
        "tauguard.detectors.alarms.monitor": "Answer",
        "display": "BackgroundDisplay",
        "lines": "LineStream",
        "listening": "Listening listen",
        "packets": "Fault Packets",
        "played": "PlayedStream",
        "ros": "RosStream",
        "stream": "RobotStream Sample StreamClosed",
        "ur": "UrStream",
        "ur_server": "UrServer",
    },
)
