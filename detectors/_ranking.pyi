import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ids = NDArray[np.int64]

def bounded_cusum(x: Array, cap: Array, state: Array, out: Array) -> None: ...
def forest(
    x: Array,
    roots: Ids,
    feature: Ids,
    threshold: Array,
    left: Ids,
    right: Ids,
    value: Array,
    base: float,
    out: Array,
    threads: int,
) -> None: ...
def network(
    x: Array,
    widths: Ids,
    weights: Array,
    biases: Array,
    centre: Array,
    scale: Array,
    out: Array,
    threads: int,
) -> None: ...
