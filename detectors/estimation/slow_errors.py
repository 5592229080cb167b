"""How uncertain a carried load is, for the filter of slow errors (``src/slow_errors.hpp``)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class LoadDeviation:
    """How uncertain the carried load is."""

    mass: float = 0.0  #: standard deviation [kg]
    moment: float = 0.0  #: of each axis of the first moment [kg m]


#: The deviation of a load that is not known.
UNKNOWN_LOAD = LoadDeviation(3.0, 0.3)
