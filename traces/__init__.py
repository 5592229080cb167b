"""The data types of recordings (signals, truth, contacts, detections), and their MCAP form."""

from tauguard.lazy import on_demand

__getattr__, __dir__, __all__ = on_demand(
    __name__,
    {
        "contacts": "CheckedContacts",
        "loads": "Load",
        "logs": "Log Logs Recording",
        "mcap": "read_mcap write_mcap",
        "resample": "resampled",
        "trace": "Alarm Collision Detection KINDS STRATA TARGETS Trace Truth stratum",
    },
)
