import numpy as np
from numpy.typing import NDArray

class Mesh:
    def __init__(
        self, vertices: NDArray[np.float64], faces: NDArray[np.int32], volume: str
    ) -> None: ...
    def overlap(
        self, other: Mesh, poses: NDArray[np.float64], out: NDArray[np.int32], threads: int
    ) -> None: ...
    def contacts(
        self, other: Mesh, poses: NDArray[np.float64], threads: int
    ) -> tuple[NDArray[np.int32], NDArray[np.float64]]: ...

def triangles_overlap(pairs: NDArray[np.float64], out: NDArray[np.bool_]) -> None: ...
