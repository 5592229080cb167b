"""Playback of traces in rerun."""

import os

# Rerun reports its use to its makers unless it is told not to; who wants that sets it to 1.
os.environ.setdefault("RERUN_ANALYTICS", "0")

from tauguard.replay.rrd import write_rrd

__all__ = ["write_rrd"]
