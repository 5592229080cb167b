from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Doubles = NDArray[np.float64]
Ints = NDArray[np.int32]
Answer = tuple[Ints, Doubles, tuple[int, int, int]]

class Scene:
    def __init__(self) -> None: ...
    def add(
        self,
        core: int,
        size: Doubles,
        radius: float,
        body: int,
        pos: Doubles,
        mat: Doubles,
        vertices: Doubles,
        normals: Doubles,
        edges: Doubles,
    ) -> None: ...
    def surface(self, vertices: Doubles, faces: Ints) -> None: ...
    def pairs(self, pairs: Ints, reach: Doubles) -> None: ...
    def find(
        self, xpos_t0: Doubles, xmat_t0: Doubles, xpos_t1: Doubles, xmat_t1: Doubles
    ) -> Answer: ...
    def find_flex(
        self,
        xpos_t0: Doubles,
        xmat_t0: Doubles,
        xpos_t1: Doubles,
        xmat_t1: Doubles,
        x_t0: Doubles,
        x_t1: Doubles,
        elements: Ints,
        radius: float,
        geoms: Ints,
        reach: Doubles,
        skip: NDArray[np.uint8],
    ) -> Answer: ...

class Guard:
    def __init__(
        self, addresses: dict[str, int], settings: dict[str, float], held: object
    ) -> None: ...
    def add(
        self,
        core: int,
        size: Doubles,
        radius: float,
        body: int,
        pos: Doubles,
        mat: Doubles,
        vertices: Doubles,
    ) -> int: ...
    def pair(self, a: Ints, b: Ints) -> None: ...
    def flex_pair(
        self, a: Ints, radii: Doubles, elements: Ints, skip: NDArray[np.uint8]
    ) -> None: ...
    def partners(self, rows: Ints) -> None: ...
    def sheet(self, ends: Ints, rest: Doubles, stiffness: Doubles) -> None: ...
    def spins(self, dofs: Ints) -> None: ...
    def pulled(self, equalities: NDArray[np.uint8]) -> None: ...
    def start(self, sheets: bool) -> None: ...
    def step(self, owner: object, each: Callable[[], None] | None) -> int: ...
    def report(
        self,
    ) -> tuple[
        int,
        int,
        list[tuple[float, int, bool]],
        list[int],
        list[int],
        list[int],
        float,
        Doubles | None,
    ]: ...
    def passing(self) -> list[Any]: ...
    def stiffened(self) -> list[int]: ...
    def close(self) -> None: ...
    def reset(self) -> None: ...

def carried(xpos: Doubles, xmat: Doubles, body: Ints, local: Doubles) -> Doubles: ...
def all_finite(a: Doubles, b: Doubles, c: Doubles) -> bool: ...
def simplices(
    x_t0: Doubles, x_t1: Doubles, a: Ints, b: Ints, pairs: Ints, distance: float
) -> Answer: ...
