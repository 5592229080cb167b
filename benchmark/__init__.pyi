"""Public names, for type checkers."""

from tauguard.benchmark.arms import ARMS as ARMS
from tauguard.benchmark.arms import Arm as Arm
from tauguard.benchmark.arms import logs as logs
from tauguard.benchmark.fetching import fetch as fetch
from tauguard.benchmark.manifest import DataSet as DataSet
from tauguard.benchmark.manifest import data_folder as data_folder
from tauguard.benchmark.manifest import is_complete as is_complete
from tauguard.benchmark.manifest import sets as sets
from tauguard.detectors.evaluation.matching import Contact as Contact
