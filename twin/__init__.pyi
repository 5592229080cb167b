"""Public names, for type checkers."""

from tauguard.twin.identify import Twin as Twin
from tauguard.twin.identify import fit_twin as fit_twin
from tauguard.twin.identify import with_intervals as with_intervals
from tauguard.twin.judge import Likeness as Likeness
from tauguard.twin.judge import compare as compare
from tauguard.twin.judge import with_alarms as with_alarms
from tauguard.twin.of_logs import TwinOfLogs as TwinOfLogs
from tauguard.twin.of_logs import identify_twin as identify_twin
from tauguard.twin.play import played as played
