"""Playback of traces in rerun."""

import os

from tauguard.lazy import on_demand
from tauguard.replay.plot import plot as plot  # a module of this name would hide it

# Rerun reports its use to its makers by default; set the variable to 1 to allow that.
os.environ.setdefault("RERUN_ANALYTICS", "0")

__getattr__, __dir__, __all__ = on_demand(
    __name__,
    {
        "browser": "BrowserReplay",
        "events": "EventFolder command_to_open",
        "live": "LiveView",
        "plot": "plot",
        "rrd": "write_rrd",
        "state_view": "StateView",
        "video": "video_frames write_video",
    },
)
