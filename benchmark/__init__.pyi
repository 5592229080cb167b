"""Public names, for type checkers."""

from tauguard.benchmark.fetching import fetch as fetch
from tauguard.benchmark.manifest import DataSet as DataSet
from tauguard.benchmark.manifest import data_folder as data_folder
from tauguard.benchmark.manifest import is_complete as is_complete
from tauguard.benchmark.manifest import sets as sets
