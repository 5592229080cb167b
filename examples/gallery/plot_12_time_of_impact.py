"""
Time of impact of two meshes
============================

Two surfaces move and turn. When do they touch first? The computed time is never late: the surfaces
do not meet before this time.
"""

import matplotlib.pyplot as plt
import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from tauguard.rigid import MeshTree, Motion, time_of_impact

shape = trimesh.creation.torus(major_radius=0.3, minor_radius=0.08)
tree = MeshTree(shape.vertices, shape.faces)

upright = np.eye(4)
upright[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
upright[:3, 3] = [1.2, 0.1, 0.05]
rest = Motion(np.eye(4), linear=[0, 0, 0], angular=[0, 0, 0])
flight = Motion(upright, linear=[-1.0, 0, 0], angular=[0.4, 1.5, 0.3])
touch = time_of_impact(tree, tree, rest, flight)
print(f"they touch at {touch.time_of_impact[0]:.6f} of the step, at {touch.point[0].round(4)} m")

# %%

figure = plt.figure(figsize=(7, 4))
axes = figure.add_axes((-0.3, -0.6, 1.6, 2.2), projection="3d")  # no room for ticks
for t, colour in ((0.0, "0.8"), (touch.time_of_impact[0], "tab:blue")):
    turn = Rotation.from_rotvec(t * np.array([0.4, 1.5, 0.3])).as_matrix() @ upright[:3, :3]
    moved = shape.vertices @ turn.T + upright[:3, 3] + t * np.array([-1.0, 0, 0])
    axes.plot_trisurf(*moved.T, triangles=shape.faces, color=colour, alpha=0.5)
axes.plot_trisurf(*shape.vertices.T, triangles=shape.faces, color="tab:orange", alpha=0.5)
axes.plot(*touch.point.T, "k*", markersize=14)
axes.set_aspect("equal")
axes.set_axis_off()
