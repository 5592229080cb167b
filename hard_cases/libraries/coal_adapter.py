"""coal's GJK on convex hulls, and its distance of meshes."""

from typing import Any

import coal
import numpy as np


class Coal:
    """``coal.collide`` with its defaults. SciPy's Qhull makes the faces; its errors are raised."""

    name = "coal"

    def convex_overlap(self, a: Any, b: Any) -> bool:
        """Overlap of two hulls."""
        request, result = coal.CollisionRequest(), coal.CollisionResult()
        still = coal.Transform3s.Identity()
        return bool(coal.collide(_hull(a), still, _hull(b), still, request, result))

    def mesh_distance(self, vertices_a: Any, faces_a: Any, vertices_b: Any, faces_b: Any) -> float:
        """Distance of two OBBRSS trees."""
        a, b = _mesh(vertices_a, faces_a), _mesh(vertices_b, faces_b)
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        still = coal.Transform3s.Identity()
        return float(coal.distance(a, still, b, still, request, result))


def _mesh(vertices: Any, faces: Any) -> Any:
    points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for point in vertices:
        points.append(np.array(point, dtype=np.float64))
    for face in faces:
        triangles.append(coal.Triangle(*face))
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(faces), len(vertices))
    model.addSubModel(points, triangles)
    model.endModel()
    return model


def _hull(points: Any) -> Any:
    from scipy.spatial import ConvexHull

    cloud, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for point in points:
        cloud.append(np.array(point, dtype=np.float64))
    # If Qhull fails (as it does on flat bodies), coal's own hull builder ends the process.
    for face in ConvexHull(points, qhull_options="Qt Pp").simplices:
        triangles.append(coal.Triangle(*map(int, face)))
    return coal.Convex(cloud, triangles)
