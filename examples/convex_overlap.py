"""Convex bodies: do they overlap, why, and when does a moving one first touch?"""

import numpy as np

from tauguard.rigid import Boxes, PlaneCache, Tetrahedra, overlap, sweep

table = Boxes(center=[[0, 0, 0]], half_extents=[[0.5, 0.5, 0.1]], rotation=[np.eye(3)])
corner = np.array([[0.0, 0, 0], [0.2, 0, 0], [0, 0.2, 0], [0, 0, 0.2]])
heights = np.linspace(0.0, 0.3, 4)
parts = Tetrahedra(corner + heights[:, None, None] * [0, 0, 1])

result = overlap(parts, table)  # one table meets every part; touching counts
print("height  hit    common point, or plane normal and offset")
for height, hit, point, normal, offset in zip(
    heights,
    result.hit,
    result.witness.point,
    result.witness.normal,
    result.witness.offset,
    strict=True,
):
    print(f"{height:.1f}     {hit!s:5}  {point if hit else (normal, round(float(offset), 3))}")

drop = sweep(table, parts, displacement=[0, 0, -0.25])  # the parts fall by 0.25 within the step
for height, time, normal in zip(heights, drop.time_of_impact, drop.normal, strict=True):
    print(f"from {height:.1f}: time of impact {time:.3f}, normal {normal}")

cache = PlaneCache(len(parts))  # tries the planes of the last frame first
for frame in range(3):
    falling = Tetrahedra(parts.vertices - [0, 0, 0.02 * frame])
    hits = cache.overlap(falling, table).hit
    print(f"frame {frame}: {hits.sum()} hits, {cache.answered} answered by last frame's planes")
