"""Meshes and moving bodies: do they meet, where, and when do they first touch?"""

import numpy as np

from tauguard.rigid import Boxes, MeshTree, Motion, time_of_impact


def ball(radius: float, rows: int = 24) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a sphere of ``2 rows^2`` triangles."""
    turn, tilt = np.meshgrid(
        2 * np.pi * np.arange(rows) / rows, np.pi * np.arange(rows + 1) / rows, indexing="ij"
    )
    flat = np.stack([np.cos(turn), np.sin(turn)], -1) * np.sin(tilt)[..., None]
    vertices = np.concatenate([flat, np.cos(tilt)[..., None]], -1)
    index = np.arange(rows * (rows + 1)).reshape(rows, rows + 1)
    here, there = index[:, :-1], np.roll(index, -1, axis=0)[:, :-1]
    faces = np.stack([here, here + 1, there, there, here + 1, there + 1], axis=-1)
    return radius * vertices.reshape(-1, 3), faces.reshape(-1, 3)


tree = MeshTree(*ball(0.1))  # one tree per mesh
poses = np.tile(np.eye(4), (3, 1, 1))
poses[:, 0, 3] = [0.15, 0.19, 0.21]  # poses of the second ball in the frame of the first
first = tree.overlap(tree, poses)
print("balls 0.2 m across, at", poses[:, 0, 3], "hit", first.hit)

contacts = tree.contacts(tree, poses[1])
print(f"{len(contacts)} pairs of triangles meet; deepest {contacts.penetration.max():.4f} m")

fall = tree.sweep(tree, poses[2], displacement=[-0.05, 0, 0])  # straight, t in [0, 1]
print(f"straight: time of impact {fall.time_of_impact[0]:.3f} at {fall.point[0].round(3)}")

# Bodies that also turn: a rod swings onto a box from above.
rod = Boxes([[0.25, 0, 0]], [[0.25, 0.01, 0.01]], [np.eye(3)])  # its end is the origin of its pose
block = Boxes([[0, 0, 0]], [[0.1, 0.1, 0.1]], [np.eye(3)])
lifted = np.eye(4)
lifted[:3, 3] = [-0.4, 0, 0.3]
swing = Motion(pose_t0=lifted, linear=[0, 0, -0.1], angular=[0, 0.6, 0])
rest = Motion(np.eye(4), linear=[0, 0, 0], angular=[0, 0, 0])
touch = time_of_impact(rod, block, swing, rest)
time, point, normal = touch.time_of_impact[0], touch.point[0].round(4), touch.normal[0]
print(f"swinging: time of impact {time:.6f} at {point}, normal {normal}")
