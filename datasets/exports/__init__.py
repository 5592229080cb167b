"""Datasets in the formats of other libraries."""

from tauguard.lazy import on_demand

__getattr__, __dir__, __all__ = on_demand(
    __name__, {"lerobot": "LEROBOT_VERSION write_lerobot", "minari": "write_minari"}
)
