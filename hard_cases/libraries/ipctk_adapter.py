"""ipctk's tight-inclusion queries (Wang et al. 2021)."""

from typing import Any

import ipctk
import numpy as np


class Ipctk:
    """The queries without rescaling of times, so that raw times of impact are compared."""

    name = "ipctk"

    def __init__(self) -> None:
        """Create the query object."""
        ipctk.set_logger_level(ipctk.LoggerLevel.error)
        self._ccd = ipctk.TightInclusionCCD(conservative_rescaling=1.0)

    def vertex_face(self, x_t0: Any, x_t1: Any) -> float | None:
        """Time of impact of a point and a triangle."""
        hit, toi = self._ccd.point_triangle_ccd(*np.array(x_t0), *np.array(x_t1))
        return float(toi) if hit else None

    def edge_edge(self, x_t0: Any, x_t1: Any) -> float | None:
        """Time of impact of two edges."""
        hit, toi = self._ccd.edge_edge_ccd(*np.array(x_t0), *np.array(x_t1))
        return float(toi) if hit else None
