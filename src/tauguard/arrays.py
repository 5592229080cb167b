"""Types of arrays that every package uses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Numbers; docstrings give units and shapes.
Array = NDArray[np.float64]
#: One mark for each element.
Bools = NDArray[np.bool_]
