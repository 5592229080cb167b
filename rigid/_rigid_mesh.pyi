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
        self, other: Mesh, poses: NDArray[np.float64], limit: int, threads: int
    ) -> tuple[NDArray[np.int32], NDArray[np.float64]]: ...
    def time_of_impact(
        self,
        other: Mesh,
        pose_a: NDArray[np.float64],
        linear_a: NDArray[np.float64],
        angular_a: NDArray[np.float64],
        pose_b: NDArray[np.float64],
        linear_b: NDArray[np.float64],
        angular_b: NDArray[np.float64],
        out: NDArray[np.float64],
        faces: NDArray[np.int32],
        threads: int,
    ) -> None: ...
    def meets(
        self,
        kind: int,
        bodies: NDArray[np.float64],
        offsets: NDArray[np.int64],
        radius: NDArray[np.float64],
        faces: NDArray[np.int32],
        threads: int,
    ) -> None: ...
    def gaps(
        self,
        kind: int,
        bodies: NDArray[np.float64],
        offsets: NDArray[np.int64],
        radius: NDArray[np.float64],
        out: NDArray[np.float64],
        faces: NDArray[np.int32],
        threads: int,
    ) -> None: ...
    def time_of_impact_of_bodies(
        self,
        kind: int,
        bodies: NDArray[np.float64],
        offsets: NDArray[np.int64],
        radius: NDArray[np.float64],
        pose_mesh: NDArray[np.float64],
        linear_mesh: NDArray[np.float64],
        angular_mesh: NDArray[np.float64],
        pose_body: NDArray[np.float64],
        linear_body: NDArray[np.float64],
        angular_body: NDArray[np.float64],
        out: NDArray[np.float64],
        faces: NDArray[np.int32],
        threads: int,
    ) -> None: ...

def time_of_impact(
    kind_a: int,
    a: NDArray[np.float64],
    offsets_a: NDArray[np.int64],
    radius_a: NDArray[np.float64],
    kind_b: int,
    b: NDArray[np.float64],
    offsets_b: NDArray[np.int64],
    radius_b: NDArray[np.float64],
    pose_a: NDArray[np.float64],
    linear_a: NDArray[np.float64],
    angular_a: NDArray[np.float64],
    pose_b: NDArray[np.float64],
    linear_b: NDArray[np.float64],
    angular_b: NDArray[np.float64],
    out: NDArray[np.float64],
    threads: int,
) -> None: ...
def gaps(
    kind_a: int,
    a: NDArray[np.float64],
    offsets_a: NDArray[np.int64],
    radius_a: NDArray[np.float64],
    kind_b: int,
    b: NDArray[np.float64],
    offsets_b: NDArray[np.int64],
    radius_b: NDArray[np.float64],
    out: NDArray[np.float64],
    threads: int,
) -> None: ...
def meets(
    kind_a: int,
    a: NDArray[np.float64],
    offsets_a: NDArray[np.int64],
    radius_a: NDArray[np.float64],
    kind_b: int,
    b: NDArray[np.float64],
    offsets_b: NDArray[np.int64],
    radius_b: NDArray[np.float64],
    hit: NDArray[np.uint8],
    threads: int,
) -> None: ...
def triangles_overlap(pairs: NDArray[np.float64], out: NDArray[np.bool_]) -> None: ...

class _Volumes:
    numbers: int
    def __init__(self, corners: NDArray[np.float64], offsets: NDArray[np.int64]) -> None: ...
    def fit(self) -> None: ...
    def place(self, poses: NDArray[np.float64]) -> None: ...
    def meet(self, pairs: NDArray[np.int64], out: NDArray[np.bool_]) -> None: ...
    def write(self, out: NDArray[np.float64]) -> None: ...

class BallVolumes(_Volumes): ...
class AabbVolumes(_Volumes): ...
class ObbVolumes(_Volumes): ...
class KDopVolumes(_Volumes): ...
