"""The data types of recordings (signals, truth, contacts, detections), and their MCAP form."""

from typing import TYPE_CHECKING

from tauguard.lazy import on_demand

if TYPE_CHECKING:
    from tauguard.traces.contacts import CheckedContacts
    from tauguard.traces.loads import Load
    from tauguard.traces.logs import Log, Logs, Recording
    from tauguard.traces.mcap import read_mcap, write_mcap
    from tauguard.traces.resample import resampled
    from tauguard.traces.trace import (
        KINDS,
        STRATA,
        TARGETS,
        Alarm,
        Collision,
        Detection,
        Trace,
        Truth,
        stratum,
    )

__all__ = [
    "KINDS", "STRATA", "TARGETS", "Alarm", "CheckedContacts", "Collision", "Detection", "Load",
    "Log", "Logs", "Recording", "Trace", "Truth", "read_mcap", "resampled", "stratum", "write_mcap",
]  # fmt: skip

__getattr__ = on_demand(__name__)
