"""The arrays that every room speaks of."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Numbers with units; shapes stand in the docstrings.
Array = NDArray[np.float64]
#: Marks, one an element.
Bools = NDArray[np.bool_]
