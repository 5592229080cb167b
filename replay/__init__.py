"""Playback of traces in rerun."""

from tauguard.replay.rrd import write_rrd

__all__ = ["write_rrd"]
