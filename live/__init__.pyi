"""Public names, for type checkers."""

from tauguard.detectors.alarms.monitor import Answer as Answer
from tauguard.live.display import BackgroundDisplay as BackgroundDisplay
from tauguard.live.lines import LineStream as LineStream
from tauguard.live.listening import Listening as Listening
from tauguard.live.listening import listen as listen
from tauguard.live.packets import Fault as Fault
from tauguard.live.packets import Packets as Packets
from tauguard.live.played import PlayedStream as PlayedStream
from tauguard.live.ros import RosStream as RosStream
from tauguard.live.stream import RobotStream as RobotStream
from tauguard.live.stream import Sample as Sample
from tauguard.live.stream import StreamClosed as StreamClosed
from tauguard.live.ur import UrStream as UrStream
from tauguard.live.ur_server import UrServer as UrServer
