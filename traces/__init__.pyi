"""Public names, for type checkers."""

from tauguard.traces.contacts import CheckedContacts as CheckedContacts
from tauguard.traces.loads import Load as Load
from tauguard.traces.logs import Log as Log
from tauguard.traces.logs import Logs as Logs
from tauguard.traces.logs import Recording as Recording
from tauguard.traces.mcap import read_mcap as read_mcap
from tauguard.traces.mcap import write_mcap as write_mcap
from tauguard.traces.resample import resampled as resampled
from tauguard.traces.trace import KINDS as KINDS
from tauguard.traces.trace import STRATA as STRATA
from tauguard.traces.trace import TARGETS as TARGETS
from tauguard.traces.trace import Alarm as Alarm
from tauguard.traces.trace import Collision as Collision
from tauguard.traces.trace import Detection as Detection
from tauguard.traces.trace import Trace as Trace
from tauguard.traces.trace import Truth as Truth
from tauguard.traces.trace import stratum as stratum
