import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]

class Robot:
    @property
    def joints(self) -> int: ...

def make_robot(
    parents: list[int],
    prismatic: list[bool],
    placements: _Array,
    axes: _Array,
    masses: _Array,
    coms: _Array,
    inertias: _Array,
    armature: _Array,
    gravity: _Array,
) -> Robot: ...
def momentum(
    robot: Robot, q: _Array, qd: _Array, p: _Array, beta: _Array, threads: int
) -> None: ...
def inverse(
    robot: Robot, q: _Array, qd: _Array, qdd: _Array, tau: _Array, threads: int
) -> None: ...

class Observer:
    def __init__(self, robot: Robot, gain: _Array) -> None: ...
    def reset(self) -> None: ...
    def step(self, dt: float, q: _Array, qd: _Array, tau: _Array, out: _Array) -> None: ...
    def run(self, t: _Array, q: _Array, qd: _Array, tau: _Array, out: _Array) -> None: ...
