"""Live robot streams (RTDE, ROS 2, lines of text, a replayed log), and a server for tests."""

from tauguard.live.lines import LineStream
from tauguard.live.played import PlayedStream
from tauguard.live.stream import RobotStream, Sample, StreamClosed
from tauguard.live.ur import UrStream
from tauguard.live.ur_server import UrServer

__all__ = [
    "LineStream", "PlayedStream", "RobotStream", "Sample", "StreamClosed", "UrServer", "UrStream",
]  # fmt: skip
