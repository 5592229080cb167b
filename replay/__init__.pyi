"""Public names, for type checkers."""

from tauguard.replay.browser import BrowserReplay as BrowserReplay
from tauguard.replay.events import EventFolder as EventFolder
from tauguard.replay.events import command_to_open as command_to_open
from tauguard.replay.live import LiveView as LiveView
from tauguard.replay.plot import plot as plot
from tauguard.replay.rrd import write_rrd as write_rrd
from tauguard.replay.state_view import StateView as StateView
from tauguard.replay.video import video_frames as video_frames
from tauguard.replay.video import write_video as write_video
