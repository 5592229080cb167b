"""tauguard's own kernels: cloth queries, convex bodies, guarded steps, the momentum observer."""

from typing import Any

import numpy as np

from tauguard.cloth import edge_edge, vertex_face
from tauguard.rigid import Hulls, MeshTree, Motion, distance, overlap, sweep, time_of_impact


class Ours:
    """Every kernel with its default settings."""

    name = "tauguard"

    def vertex_face(self, x_t0: Any, x_t1: Any) -> float | None:
        """The method ab2pf."""
        return _first(vertex_face([x_t0], [x_t1]).toi)

    def edge_edge(self, x_t0: Any, x_t1: Any) -> float | None:
        """The method ab2pf."""
        return _first(edge_edge([x_t0], [x_t1]).toi)

    def convex_overlap(self, a: Any, b: Any) -> bool:
        """Convex hulls, the method ``auto``."""
        return bool(overlap(_hull(a), _hull(b)).hit[0])

    def convex_sweep(self, a: Any, b: Any, displacement: Any) -> float | None:
        """Convex hulls, the method ``auto``."""
        return _first(sweep(_hull(a), _hull(b), displacement).time_of_impact)

    def convex_motion(self, a: Any, b: Any, motion_a: Any, motion_b: Any) -> float | None:
        """Convex hulls at constant linear and angular velocity."""
        found = time_of_impact(_hull(a), _hull(b), _motion(motion_a), _motion(motion_b))
        return _first(found.time_of_impact)

    def mesh_distance(self, vertices_a: Any, faces_a: Any, vertices_b: Any, faces_b: Any) -> float:
        """Signed distance of two trees."""
        a, b = MeshTree(vertices_a, faces_a), MeshTree(vertices_b, faces_b)
        return float(distance(a, b).distance[0])

    def point_in_mesh(self, vertices: Any, faces: Any, point: Any) -> bool:
        """Containment in a tree."""
        return bool(MeshTree(vertices, faces).contains([point])[0])

    def mesh_ray(self, vertices: Any, faces: Any, origin: Any, direction: Any) -> float | None:
        """The first face of a tree."""
        length = MeshTree(vertices, faces).cast(origin, direction).distance
        return _first(length / np.linalg.norm(direction))

    def scene(self, mjcf: str, seconds: float) -> float:
        """Steps of :class:`~tauguard.contacts.GuardedStepper`."""
        from tauguard.contacts import GuardedStepper
        from tauguard.hard_cases.libraries.mujoco_adapter import answer, start

        model, data = start(mjcf)
        with GuardedStepper(model, data) as stepper:
            while data.time < seconds - model.opt.timestep / 2:
                stepper.step()
        return answer(model, data)

    def observer(self, mjcf: str, t: Any, q: Any, qd: Any, tau: Any, gain: float) -> float:
        """The momentum observer of the nominal model."""
        from tauguard.detectors import RobotNumbers, observe
        from tauguard.models import pin_model

        return float(observe(RobotNumbers.from_pin(pin_model(mjcf)), t, q, qd, tau, gain)[-1, 0])


def _hull(points: Any) -> Hulls:
    return Hulls(np.array(points, dtype=np.float64), np.array([0, len(points)]))


def _motion(given: Any) -> Motion:
    from scipy.spatial.transform import Rotation

    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec(given["rotation"]).as_matrix()
    pose[:3, 3] = given["position"]
    return Motion(pose, given["linear"], given["angular"])


def _first(times: Any) -> float | None:
    return float(times[0]) if np.isfinite(times[0]) else None
