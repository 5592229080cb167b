"""Public names, for type checkers."""

from tauguard.replay.events import EventFolder as EventFolder
from tauguard.replay.events import command_to_open as command_to_open
from tauguard.replay.plot import plot as plot
from tauguard.replay.rrd import write_rrd as write_rrd
from tauguard.replay.state_view import StateView as StateView
