"""Twins: simulated arms identified from collision-free logs of real arms, tested on other logs."""

from tauguard.twin.identify import Twin, fit_twin, with_intervals
from tauguard.twin.judge import Likeness, compare, with_alarms
from tauguard.twin.of_logs import TwinOfLogs, identify_twin
from tauguard.twin.play import played

__all__ = [
    "Likeness", "Twin", "TwinOfLogs", "compare", "fit_twin", "identify_twin", "played",
    "with_alarms", "with_intervals",
]  # fmt: skip
