"""Twins: simulated arms identified from collision-free logs of real arms, tested on other logs."""

from tauguard.lazy import on_demand

__getattr__, __dir__, __all__ = on_demand(
    __name__,
    {
        "identify": "Twin fit_twin with_intervals",
        "judge": "Likeness compare with_alarms",
        "of_logs": "TwinOfLogs identify_twin",
        "play": "played",
    },
)
