"""Moving triangles against one another: the native kernel beside dense samples of closed forms."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tauguard.contacts._contacts import simplices
from tauguard.contacts.ground_truth import triangles as closed

PAIR = np.array([[0, 0]], dtype=np.int32)
ONE = np.array([[0, 1, 2]], dtype=np.int32)
OTHER = np.array([[3, 4, 5]], dtype=np.int32)


def distance(a, b):
    """Of triangles a and b, both (K, 3, 3), unless they cross: then 0."""
    best = np.full(len(a), np.inf)
    for one, other in ((a, b), (b, a)):
        for k in range(3):
            start, stop = one[:, k], one[:, (k + 1) % 3]
            best = np.minimum(best, closed.segment_triangle(start, stop, other))
    return best


def sweep(x_t0, x_t1, thickness):
    return simplices(x_t0, x_t1, ONE, OTHER, PAIR, thickness)


@given(st.integers(0, 10**9), st.sampled_from([0.0, 0.01, 0.2]))
@example(14, 0.01)  # the certificate is a line: its root is hidden by rounding
@example(991, 0.01)
@example(1126, 0.0)
@settings(deadline=None, max_examples=60)
def test_the_first_time_is_never_late_and_nearly_exact(seed, thickness):
    rng = np.random.default_rng(seed)
    x_t0 = rng.normal(size=(6, 3))
    x_t0[3:] += rng.normal(size=3)
    x_t1 = x_t0 + 0.3 * rng.normal(size=(6, 3)) + np.repeat(rng.normal(size=(2, 3)), 3, axis=0)
    ids, values, _ = sweep(x_t0, x_t1, thickness)
    t = np.linspace(0, 1, 601)[:, None, None]
    x = x_t0 + t * (x_t1 - x_t0)
    d = distance(x[:, :3], x[:, 3:]) - thickness
    # Between samples a distance changes by less than this.
    change = 2 * np.linalg.norm(x_t1 - x_t0, axis=1).max() / 600
    touching = d <= 0
    if touching.any():
        first = t[np.argmax(touching), 0, 0]
        assert len(ids) == 1
        assert values[0, 0] <= first + 1e-12
    if len(ids):
        at = x_t0 + values[0, 0] * (x_t1 - x_t0)
        here = distance(at[None, :3], at[None, 3:])[0] - thickness
        assert here <= 1e-8 if values[0, 0] > 0 else here <= 1e-9
    else:
        assert d.min() > 0
    if d.min() > change + 1e-8:
        assert len(ids) == 0


@pytest.mark.parametrize("flat", ["point", "needle", "doubled"])
def test_triangles_without_area(flat):
    corners = {
        "point": [[0, 0, 1], [0, 0, 1], [0, 0, 1]],
        "needle": [[-1, 0, 1], [0, 0, 1], [1, 0, 1]],
        "doubled": [[0, 0, 1], [0, 0, 1], [0.5, 0.2, 1]],
    }[flat]
    x_t0 = np.array([[-2, -2, 0], [2, -2, 0], [0, 3, 0], *corners], dtype=float)
    x_t1 = x_t0.copy()
    x_t1[3:, 2] -= 2
    ids, values, _ = sweep(x_t0, x_t1, 0.02)
    assert len(ids) == 1
    assert values[0, 0] == pytest.approx(0.98 / 2, abs=1e-8)
    assert abs(values[0, 7]) == pytest.approx(1)


def test_in_one_plane():
    """Two triangles slide towards one another in their common plane."""
    x_t0 = np.array([[0, -1, 0], [0, 1, 0], [-1, 0, 0], [1, 0, 0], [2, 1, 0], [2, -1, 0.0]])
    x_t1 = x_t0.copy()
    x_t1[3:, 0] -= 2
    ids, values, _ = sweep(x_t0, x_t1, 0.0)
    assert len(ids) == 1
    assert values[0, 0] == pytest.approx(0.5, abs=1e-9)
    ids, values, _ = sweep(x_t0, x_t1, 0.1)
    assert values[0, 0] == pytest.approx(0.45, abs=1e-9)
