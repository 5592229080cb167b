"""ipctk's tight-inclusion queries (Wang et al. 2021); times are not rescaled."""

from typing import Any

import ipctk
import numpy as np


class Ipctk:
    """Times are not scaled back towards the start, so that they are compared as they are."""

    name = "ipctk"

    def __init__(self) -> None:
        """Make the query."""
        ipctk.set_logger_level(ipctk.LoggerLevel.error)
        self._ccd = ipctk.TightInclusionCCD(conservative_rescaling=1.0)

    def vertex_face(self, x_t0: Any, x_t1: Any) -> float | None:
        """Point against triangle."""
        hit, toi = self._ccd.point_triangle_ccd(*np.array(x_t0), *np.array(x_t1))
        return float(toi) if hit else None

    def edge_edge(self, x_t0: Any, x_t1: Any) -> float | None:
        """Edge against edge."""
        hit, toi = self._ccd.edge_edge_ccd(*np.array(x_t0), *np.array(x_t1))
        return float(toi) if hit else None
