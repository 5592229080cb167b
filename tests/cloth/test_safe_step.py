"""``safe_step``: no contact in the scaled step, near the first contact, cost in proportion."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.cloth import MeshCCD

FACES, RODS, POINTS = [[0, 1, 2], [3, 4, 5]], [[6, 7], [8, 9]], [10, 11, 12]
BOX = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
SIDES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
     [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)  # fmt: skip


def two_boxes(offset):
    """Two unit boxes, the second one moved by ``offset``: the mesh and its positions."""
    return MeshCCD(np.concatenate([SIDES, SIDES + 8])), np.concatenate([BOX, BOX + offset])


def moved(x, second):
    end = x.copy()
    end[8:] += second
    return end


@settings(deadline=None, max_examples=100)
@given(st.lists(st.integers(-3, 3), min_size=78, max_size=78), st.floats(0.05, 0.95))
def test_a_safe_step_meets_nothing_and_is_not_timid(numbers, fraction):
    x = np.array(numbers, dtype=float).reshape(2, 13, 3)
    ccd = MeshCCD(FACES, edges=RODS, points=POINTS)
    share = ccd.safe_step(*x, fraction=fraction)
    first = ccd.find(*x).first_time()
    assert 0 <= share <= 1
    if share > 0:  # features that touch at the start are apart soon after it
        reach = x[0] + share * (x[1] - x[0])
        assert ccd.find(x[0] + 0.01 * (reach - x[0]), reach).first_time() == np.inf
        if first > 0:
            assert ccd.find(x[0], reach).first_time() == np.inf
            assert share == 1 or share <= first
    if first == np.inf:
        assert share == 1
    if first > 1e-6 and np.isfinite(first):
        assert share >= 0.5 * fraction * first


@pytest.mark.parametrize(
    ("offset", "move", "share"),
    [
        ([0, 0, 1], [0, 0, 2], 1),  # faces that touch
        ([0, 0, 1], [0.3, -0.2, 1], 1),
        ([1, 1, 0], [1, 0.5, 0], 1),  # edges that touch
        ([1, 1, 1], [0, 0, 1], 1),  # corners that touch
        ([0.3, 0.2, 1], [0, 0, 0.5], 1),
        ([0, 0, 1], [0, 0, -0.1], 0),
        ([0, 0, 1], [1, 0, -1e-3], 0),
        ([0, 0, 1], [1, 0, 0], 0),  # slides along the face
        ([0, 0, 0.5], [0, 0, 0.2], 0),  # intersects, and goes on doing so
    ],
)
@pytest.mark.parametrize("far", [0, 1000])
def test_boxes_that_touch(offset, move, share, far):
    ccd, x = two_boxes(np.array(offset, dtype=float))
    x = x + far
    assert ccd.safe_step(x, moved(x, move)) == share


def test_features_closer_than_the_minimum_distance():
    ccd, x = two_boxes(np.array([0.1, 0, 1.02]))
    assert ccd.safe_step(x, moved(x, [0, 0, 0.05]), min_distance=0.1) == 1
    assert ccd.safe_step(x, moved(x, [0.2, 0, 0]), min_distance=0.1) == 1  # the distance stays
    assert ccd.safe_step(x, moved(x, [0.2, 0, -0.01]), min_distance=0.1) == 0
    assert ccd.safe_step(x, moved(x, [0, 0, -1]), min_distance=0.01) == pytest.approx(0.009)


def test_boxes_that_touch_and_meet_a_third_one():
    ccd = MeshCCD(np.concatenate([SIDES, SIDES + 8, SIDES + 16]))
    x = np.concatenate([BOX + np.array([0, 0, z]) for z in (0, 1, 4)])
    assert ccd.safe_step(x, moved(x, [0, 0, 0.5])) == 1
    end = x.copy()
    end[8:16] += [0, 0, 4]
    assert ccd.safe_step(x, end) == pytest.approx(0.45)


def crumpled(size, scale, seed=0):
    """Two sheets of ``size`` x ``size`` quads, and a displacement at random."""
    ids = np.arange((size + 1) ** 2).reshape(size + 1, -1)
    a, b, c, d = (x.ravel() for x in (ids[:-1, :-1], ids[1:, :-1], ids[1:, 1:], ids[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    u, v = np.meshgrid(np.linspace(0, 1, size + 1), np.linspace(0, 1, size + 1), indexing="ij")
    sheet = np.stack([u.ravel(), v.ravel(), 0 * u.ravel()], axis=1)
    x = np.concatenate([sheet, sheet + np.array([0, 0, 0.5])])
    end = x + scale * np.random.default_rng(seed).normal(size=x.shape)
    return MeshCCD(np.concatenate([faces, faces + len(sheet)])), x, end


@pytest.mark.parametrize("scale", [0.001, 0.1, 1.0])
def test_the_step_length_is_that_of_the_first_collision(scale):
    ccd, x, end = crumpled(8, scale)
    first = ccd.find(x, end).first_time()
    assert ccd.safe_step(x, end) == pytest.approx(min(1, 0.9 * first), rel=1e-8)


def test_wild_steps_stay_within_the_work_before_the_first_collision():
    """The whole step has millions of collisions; a limit of 1,000 suffices for its first part."""
    ccd, x, end = crumpled(32, 1e6)
    share = ccd.safe_step(x, end, limit=1000)
    assert 0 < share < 1e-6
    assert ccd.find(x, x + share * (end - x)).first_time() == np.inf
    assert ccd.find(x, x + share / 0.9 * (1 + 1e-6) * (end - x)).first_time() <= 1
    with pytest.raises(ValueError, match="limit: more than"):
        ccd.find(x, end, limit=1000)


def test_a_start_full_of_contacts_says_the_limit():
    ccd, x = two_boxes(np.zeros(3))
    assert ccd.safe_step(x, moved(x, [1e-3, 0, 0])) == 0
    with pytest.raises(ValueError, match="limit: more than 3 "):
        ccd.safe_step(x, moved(x, [1e-3, 0, 0]), limit=3)


def test_a_long_flight_of_the_whole_mesh_is_one_step():
    ccd, x, _ = crumpled(8, 0)
    assert ccd.safe_step(x, x + 1e6) == 1


@pytest.mark.parametrize("fraction", [0, 1, -1, 2, np.nan, "a", None])
def test_a_fraction_outside_0_1_is_refused(fraction):
    with pytest.raises(ValueError, match="fraction: "):
        MeshCCD([[0, 1, 2]]).safe_step(np.zeros((3, 3)), np.zeros((3, 3)), fraction=fraction)
