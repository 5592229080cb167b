"""Playback of traces in rerun."""

import os

# Rerun reports its use to its makers by default; set the variable to 1 to allow that.
os.environ.setdefault("RERUN_ANALYTICS", "0")

from tauguard.replay.plot import plot
from tauguard.replay.rrd import write_rrd

__all__ = ["plot", "write_rrd"]
