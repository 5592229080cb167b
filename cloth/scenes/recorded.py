"""Recorded sequences with one mesh file per frame, as in the UNC dynamic-scene benchmarks."""

import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tauguard.cloth.scenes.mesh_file import load_mesh

Points = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MeshSequence:
    """The frames of one mesh, each read when it is used.

    Attributes:
        faces: Shape (F, 3), the same in every frame.
        files: One file per frame, in order.
    """

    faces: NDArray[np.int32]
    files: tuple[Path, ...]

    def __len__(self) -> int:
        """The number of frames."""
        return len(self.files)

    def positions(self, frame: int) -> Points:
        """Positions of a frame, shape (V, 3), in the file's unit.

        Raises:
            ValueError: its faces differ from those of the first frame, or it cannot be read.
        """
        x, faces = read_mesh(self.files[frame])
        if not np.array_equal(faces, self.faces):
            raise ValueError(f"{self.files[frame]}: its faces differ from {self.files[0]}")
        return x

    def steps(self) -> Iterator[tuple[Points, Points]]:
        """Positions at both ends of each step."""
        end = self.positions(0)
        for i in range(1, len(self.files)):
            start, end = end, self.positions(i)
            if len(start) != len(end):
                raise ValueError(
                    f"{self.files[i]}: {len(end)} vertices, {self.files[i - 1]} has {len(start)}"
                )
            yield start, end


def load_sequence(folder: str | Path, pattern: str = "*") -> MeshSequence:
    """The PLY or OBJ files of a folder as one sequence, ordered by the last number in their names.

    Args:
        folder: Folder of the frames, for example of ``http://gamma.cs.unc.edu/DYNAMICB``.
        pattern: Glob of the files, for a folder with several meshes, such as ``"cloth*.ply"``.

    Raises:
        ValueError: no file matches, or the first cannot be read as a triangle mesh.
    """
    files = sorted(
        (p for p in Path(folder).glob(pattern) if p.suffix.lower() in (".ply", ".obj")), key=_order
    )
    if not files:
        missing = "" if Path(folder).is_dir() else ": there is no such folder"
        raise ValueError(f"{folder}: no .ply or .obj file matches {pattern!r}{missing}")
    return MeshSequence(read_mesh(files[0])[1], tuple(files))


def read_mesh(path: str | Path) -> tuple[Points, NDArray[np.int32]]:
    """Vertices, shape (V, 3), and faces, shape (F, 3), in the file's order, nothing merged.

    Warns if vertices belong to no face.
    """
    vertices, faces = load_mesh(path)
    unused = len(vertices) - len(np.unique(faces))
    if unused:
        warnings.warn(
            f"{path}: {unused} of {len(vertices)} vertices belong to no face; MeshCCD asks about "
            "them only where points= or edges= names them",
            stacklevel=2,
        )
    return vertices, faces


def _order(path: Path) -> tuple[int, str]:
    numbers = re.findall(r"\d+", path.stem)
    return (int(numbers[-1]) if numbers else -1, path.name)
