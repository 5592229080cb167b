"""Whether inertial numbers are those of bodies, by Pinocchio."""

import numpy as np
import pinocchio as pin


def is_physically_consistent(inertial):
    """Whether the numbers, shape (..., 10), are those of bodies of positive density."""
    bodies = [pin.Inertia.FromDynamicParameters(row) for row in inertial.reshape(-1, 10)]
    return all(np.linalg.eigvalsh(b.toPseudoInertia().toMatrix())[0] > 0 for b in bodies)
