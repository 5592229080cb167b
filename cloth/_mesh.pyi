from typing import Any

import numpy as np
from numpy.typing import NDArray

class Mesh:
    def __init__(
        self,
        faces: NDArray[np.int32],
        ids: NDArray[np.int32],
        meets: NDArray[np.uint8],
        k: int,
        moving: bool,
        threads: int,
    ) -> None: ...
    def edges(self) -> NDArray[np.int32]: ...
    def candidates(
        self,
        x_t0: NDArray[np.float64],
        x_t1: NDArray[np.float64],
        min_distance: float,
        fresh: bool,
        limit: int,
    ) -> tuple[NDArray[np.int32], NDArray[np.int32], dict[str, Any]]: ...
    def find(
        self,
        x_t0: NDArray[np.float64],
        x_t1: NDArray[np.float64],
        method: int,
        min_distance: float,
        fresh: bool,
        limit: int,
    ) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]: ...
    def update_topology(
        self, faces: NDArray[np.int32], ids: NDArray[np.int32], meets: NDArray[np.uint8]
    ) -> dict[str, Any]: ...

def leaf_pair(
    variant: str,
    a: NDArray[np.float32],
    b: NDArray[np.float32],
    vertices_a: NDArray[np.int32],
    vertices_b: NDArray[np.int32],
    same: bool,
) -> NDArray[np.int32]: ...
def solve(
    vf: bool,
    x_t0: NDArray[np.float64],
    x_t1: NDArray[np.float64],
    rows: NDArray[np.int32],
    method: int,
    min_distance: float,
    hit: NDArray[np.uint8],
    toi: NDArray[np.float64],
    point: NDArray[np.float64],
    normal: NDArray[np.float64],
    weights: NDArray[np.float64],
) -> dict[str, int]: ...
def force_batch_kernels(name: str) -> bool: ...
