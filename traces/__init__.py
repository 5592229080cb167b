"""The typed values that flow through tauguard, and their MCAP form."""

from tauguard.traces.trace import KINDS, Alarm, Collision, Detection, Trace, Truth

__all__ = ["KINDS", "Alarm", "Collision", "Detection", "Trace", "Truth"]
