import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

class KernelSum:
    def __init__(self, vectors: Array, coef: Array, intercept: float, sigma: float) -> None: ...
    def rows(self, x: Array, out: Array, threads: int) -> None: ...
    def series(self, signal: Array, lag: int, count: int, out: Array, threads: int) -> None: ...

class Sliding:
    def __init__(
        self,
        kernel: KernelSum,
        joints: NDArray[np.int64],
        weights: Array,
        units: float,
        factor: float,
        compress: bool,
        lag: int,
        count: int,
    ) -> None: ...
    def reset(self) -> None: ...
    def step(self, left: Array, qd: Array, acceleration: Array) -> float: ...

def gram(a: Array, b: Array, sigma: float, out: Array, threads: int) -> None: ...
def windows(signal: Array, ends: NDArray[np.int64], lag: int, count: int, out: Array) -> None: ...
