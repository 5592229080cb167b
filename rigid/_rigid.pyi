import numpy as np
from numpy.typing import NDArray

# convex bodies
def has_avx2() -> bool: ...
def allow_vectors(allowed: bool) -> None: ...
def overlap(
    kind_a: int,
    a: NDArray[np.float64],
    offsets_a: NDArray[np.int64],
    kind_b: int,
    b: NDArray[np.float64],
    offsets_b: NDArray[np.int64],
    method: int,
    threads: int,
    hit: NDArray[np.uint8],
) -> int: ...
def overlap_boxes(
    a: NDArray[np.float64],
    blocks_a: NDArray[np.float64],
    b: NDArray[np.float64],
    blocks_b: NDArray[np.float64],
    skew: float,
    threads: int,
    hit: NDArray[np.uint8],
) -> int: ...
def box_skew(rotation: NDArray[np.float64], tolerance: float) -> tuple[float, int]: ...
def pack_boxes(packed: NDArray[np.float64], blocks: NDArray[np.float64]) -> None: ...
def sweep(
    kind_a: int,
    a: NDArray[np.float64],
    offsets_a: NDArray[np.int64],
    kind_b: int,
    b: NDArray[np.float64],
    offsets_b: NDArray[np.int64],
    displacement: NDArray[np.float64],
    method: int,
    threads: int,
    points: bool,
    hit: NDArray[np.uint8],
    out: NDArray[np.float64],
) -> int: ...
def overlap_cached(
    kind_a: int,
    a: NDArray[np.float64],
    offsets_a: NDArray[np.int64],
    kind_b: int,
    b: NDArray[np.float64],
    offsets_b: NDArray[np.int64],
    threads: int,
    normals: NDArray[np.float64],
    hit: NDArray[np.uint8],
) -> int: ...
def witnesses(
    kind_a: int,
    a: NDArray[np.float64],
    offsets_a: NDArray[np.int64],
    kind_b: int,
    b: NDArray[np.float64],
    offsets_b: NDArray[np.int64],
    threads: int,
    hit: NDArray[np.uint8],
    out: NDArray[np.float64],
) -> None: ...
