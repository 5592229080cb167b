"""The open benchmark of collision detection on real arms: logs, their truth, and how to fetch them.

``tauguard data fetch`` downloads the originals and converts them. ``logs("ur5")`` gives the logs of
one arm with their contacts.
"""

from tauguard.lazy import on_demand

__getattr__, __dir__, __all__ = on_demand(
    __name__,
    {
        "arms": "ARMS Arm logs",
        "fetching": "fetch",
        "manifest": "DataSet data_folder is_complete sets",
        "tauguard.detectors.evaluation.matching": "Contact",
    },
)
