"""Motions: limits kept, derivatives consistent, dwells at rest."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.envs.episodes.motions import Workspace, point_to_point, random_motion

SPACE = Workspace(
    low=-np.ones(6),
    high=np.ones(6),
    max_speed=np.array([2.1, 2.1, 3.1, 3.1, 3.1, 3.1]),
    max_acceleration=np.full(6, 10.0),
)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32), speed=st.floats(1.01, 100))
def test_speed_and_acceleration_limits_are_kept(seed, speed):
    motion = random_motion(np.random.default_rng(seed), SPACE, 10.0, speed)
    assert len(motion.t) == 10_000
    assert (np.abs(motion.qd) <= SPACE.max_speed * speed / 100 * (1 + 1e-9)).all()
    assert (np.abs(motion.qdd) <= SPACE.max_acceleration * (1 + 1e-9)).all()
    assert (motion.q >= -1 - 1e-12).all()
    assert (motion.q <= 1 + 1e-12).all()


def test_the_speed_asked_for_is_reached():
    motion = random_motion(np.random.default_rng(1), SPACE, 120.0, 30)
    share = np.abs(motion.qd) / SPACE.max_speed
    assert share.max() == pytest.approx(0.30, rel=1e-3)


def test_velocity_and_acceleration_are_the_derivatives():
    motion = random_motion(np.random.default_rng(2), SPACE, 30.0, 60)
    slope = (motion.q[2:] - motion.q[:-2]) / 2e-3
    np.testing.assert_allclose(slope, motion.qd[1:-1], atol=2e-3)
    smooth = np.abs(np.diff(motion.qdd, axis=0)).max(axis=1) < 1.0
    curve = (motion.qd[2:] - motion.qd[:-2]) / 2e-3
    inner = smooth[:-1] & smooth[1:]
    np.testing.assert_allclose(curve[inner], motion.qdd[1:-1][inner], atol=0.5)


def test_point_to_point_starts_and_ends_at_the_waypoints():
    motion = point_to_point([[0.0], [1.0], [0.5]], [1.0, 0.5], [0.1, 0.2, 0.3], 1e-3)
    assert motion.q[0, 0] == 0
    assert motion.q[-1, 0] == 0.5
    assert len(motion.q) == 2100
    assert np.abs(motion.qd[:100]).max() == 0


def test_bad_input_is_named():
    with pytest.raises(ValueError, match="above 1 and at most 100"):
        random_motion(np.random.default_rng(0), SPACE, 1.0, 0)
    with pytest.raises(ValueError, match="3 waypoints need 2 durations"):
        point_to_point([[0.0], [1.0], [2.0]], [1.0], [0, 0, 0], 1e-3)
    closed = Workspace(
        *(SPACE.low, SPACE.high, SPACE.max_speed, SPACE.max_acceleration), lambda q: False
    )
    with pytest.raises(ValueError, match="widen the workspace"):
        random_motion(np.random.default_rng(0), closed, 1.0, 10)
