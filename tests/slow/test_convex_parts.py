"""Convex parts of an L: they cover it, and leave its corner free."""

import numpy as np
import pytest

from tauguard.rigid import Spheres, convex_parts, distance
from tests.rigid.test_mesh_points import box, joined

pytestmark = pytest.mark.slow


def test_parts_of_an_l_cover_it_and_leave_its_corner_free(slow_seed):
    pytest.importorskip("coacd")
    angle = joined(box([0, 0, 0], [3, 1, 1]), box([0, 1, 0], [1, 3, 1]))
    parts = convex_parts(angle, seed=slow_seed)
    assert len(parts) == 2
    points = np.random.default_rng(slow_seed).uniform(-0.5, 3.5, (500, 3))
    gaps = np.min([distance(part, Spheres(points, 0)).distance for part in parts], axis=0)
    truth = angle.signed_distance(points).distance
    assert (gaps <= 0)[truth < -0.05].all()
    assert (gaps > 0)[truth > 0.2].all()
