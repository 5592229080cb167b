"""Decomposition of a mesh into convex parts, by CoACD."""

from __future__ import annotations

import numpy as np

from tauguard.findings import ArgumentError
from tauguard.rigid.mesh import MeshTree
from tauguard.rigid.shapes import Hulls


def convex_parts(
    mesh: MeshTree, concavity: float = 0.05, most: int | None = None, seed: int = 0
) -> Hulls:
    """Convex bodies that together cover a mesh, for queries and scenes that need convex bodies.

    The method is CoACD (Wei, Liu, Ling and Su 2022, "Approximate convex decomposition for 3D meshes
    with collision-aware concavity and tree search"). It takes seconds to minutes. The parts
    approximate the mesh: where exact answers matter, query the :class:`MeshTree` itself. It needs
    the package ``coacd``: ``pip install 'tauguard[meshes]'``.

    Args:
        mesh: Any mesh; an open one is closed by remeshing first.
        concavity: Largest concavity of a part, as a fraction of the mesh's size, from 0.01 (many
            parts) to 1. It is about the distance by which a part may stand out of the mesh.
        most: Largest number of parts. ``None``: as many as needed.
        seed: Seed of the search.

    Returns:
        One hull per part, in the mesh's frame.

    Raises:
        ArgumentError: no ``MeshTree``, or a number out of its range.
        ModuleNotFoundError: ``coacd`` is not installed.
    """
    if not isinstance(mesh, MeshTree):
        raise ArgumentError(f"mesh: a {type(mesh).__name__}, expected a MeshTree")
    if not 0.01 <= concavity <= 1:
        raise ArgumentError(f"concavity: {concavity!r:.40}, expected a number from 0.01 to 1")
    if most is not None and not 1 <= most <= 10_000:
        raise ArgumentError(f"most: {most!r:.40}, expected an integer from 1 to 10000")
    try:
        import coacd
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            "convex_parts needs the package coacd: pip install 'tauguard[meshes]'"
        ) from error
    coacd.set_log_level("error")
    parts = coacd.run_coacd(
        coacd.Mesh(mesh.vertices, mesh.faces),
        threshold=float(concavity),
        max_convex_hull=-1 if most is None else int(most),
        seed=int(seed),
    )
    corners = [np.asarray(vertices, dtype=np.float64) for vertices, _ in parts]
    return Hulls(np.concatenate(corners), np.cumsum([0, *map(len, corners)]))
