"""Bodies that can exist: Pinocchio's pseudo-inertia is the truth."""

import numpy as np
import pinocchio as pin
from hypothesis import given, settings
from hypothesis import strategies as st

from oracles.physical_bodies import is_physically_consistent
from tauguard.detectors.dynamics.physical_consistency import (
    coordinates,
    from_coordinates,
    inertial_numbers,
    pseudo_inertia,
    solve_physically_consistent,
)

theta = st.lists(st.floats(-1.5, 1.5), min_size=10, max_size=10).map(np.array)


def body(seed):
    pin.seed(seed)
    return pin.Inertia.Random()


@given(st.integers(0, 10_000))
@settings(max_examples=50)
def test_pseudo_inertia_is_pinocchios(seed):
    inertia = body(seed)
    numbers = inertia.toDynamicParameters()
    theirs = inertia.toPseudoInertia().toMatrix()
    np.testing.assert_allclose(pseudo_inertia(numbers), theirs, atol=1e-10)
    np.testing.assert_allclose(inertial_numbers(theirs), numbers, atol=1e-10)


@given(theta)
@settings(max_examples=50)
def test_every_coordinate_is_a_body(values):
    numbers, derivative = from_coordinates(values)
    assert is_physically_consistent(numbers)
    np.testing.assert_allclose(coordinates(numbers, 0.0), values, atol=1e-6)
    step = 1e-6
    for k in range(10):
        moved = values.copy()
        moved[k] += step
        slope = (from_coordinates(moved)[0] - numbers) / step
        np.testing.assert_allclose(derivative[:, k], slope, rtol=1e-3, atol=1e-3)


def test_least_squares_stays_with_bodies():
    believed = np.array([body(1).toDynamicParameters(), body(2).toDynamicParameters()])
    rng = np.random.default_rng(0)
    design = rng.normal(size=(400, 25))
    impossible = np.zeros(25)
    impossible[4:10] = believed[0, 4:] + [1, 0, -1, 0, 0, 0]  # a negative moment of inertia
    impossible[20:22] = 0.3, 5.0  # an armature below 0
    matrix, vector = design.T @ design, design.T @ (design @ impossible)
    armature = np.array([1.0, 1.0])
    x = solve_physically_consistent(matrix, vector, believed, armature)
    assert is_physically_consistent(believed - x[:20].reshape(2, 10))
    assert (armature - x[20:22] > 0).all()
    free = np.linalg.solve(matrix, vector)
    assert not is_physically_consistent(believed - free[:20].reshape(2, 10))
    possible = np.zeros(25)
    possible[22:] = 1.0, -2.0, 3.0
    x = solve_physically_consistent(1e6 * matrix, 1e6 * matrix @ possible, believed, armature)
    np.testing.assert_allclose(x, possible, atol=2e-3)


def test_a_flat_body_is_moved_inside():
    flat = inertial_numbers(np.diag([1.0, 0.0, 1.0, 2.0]))
    assert not is_physically_consistent(flat)
    assert is_physically_consistent(from_coordinates(coordinates(flat))[0])
