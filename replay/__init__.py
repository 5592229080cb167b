"""Playback of traces in rerun."""

import os
from typing import TYPE_CHECKING

from tauguard.lazy import on_demand
from tauguard.replay.plot import plot

if TYPE_CHECKING:
    from tauguard.replay.events import EventFolder, command_to_open
    from tauguard.replay.rrd import write_rrd

# Rerun reports its use to its makers by default; set the variable to 1 to allow that.
os.environ.setdefault("RERUN_ANALYTICS", "0")

__getattr__ = on_demand(__name__)

__all__ = ["EventFolder", "command_to_open", "plot", "write_rrd"]
