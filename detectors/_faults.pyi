import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

class Check:
    def __init__(
        self,
        dt: float,
        longest: float,
        odd: int,
        speed: float,
        repeats: int,
        window: int,
        share: float,
        step_share: float,
        current: Array,
        step: Array,
        drift: Array,
        stuck: Counts,
        /,
    ) -> None: ...
    def step(self, t: float, q: Array, qd: Array, current: Array, /) -> tuple[int, int, float]: ...
    def reset(self) -> None: ...

class Torques:
    def __init__(
        self, gain: Array, noise: Array, rate: float, opposed: Array, least: Array, most: Array, /
    ) -> None: ...
    def step(self, residual: Array, current: Array, dt: float, /) -> tuple[int, int, float]: ...
    def extremes(self) -> list[float]: ...
