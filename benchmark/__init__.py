"""The open benchmark of collision detection on real arms: logs, their truth, and how to fetch them.

``tauguard data fetch`` downloads the originals and converts them. ``logs("ur5")`` gives the logs of
one arm with their contacts.
"""

from typing import TYPE_CHECKING

from tauguard.lazy import on_demand

if TYPE_CHECKING:
    from tauguard.benchmark.fetching import fetch
    from tauguard.benchmark.manifest import DataSet, data_folder, sets

__all__ = ["DataSet", "data_folder", "fetch", "sets"]

__getattr__ = on_demand(__name__)
