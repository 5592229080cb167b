"""The oracles of rigid bodies see what is wrong, and the kernels are right by them."""

import numpy as np
import pytest

from oracles.convex_distance import relative_error
from oracles.convex_impact import bracket, impact_errors
from oracles.convex_pairs import moving_pairs, pairs_by_outcome, shifted, take
from oracles.hull_volumes import HullVolumes, enclosed
from tauguard.rigid import Boxes, Motion, PlaneCache, Tetrahedra, overlap, time_of_impact
from tauguard.rigid.comparators import VOLUMES

PAIRS = [("tetrahedra", "tetrahedra"), ("boxes", "boxes"), ("parallelepipeds", "tetrahedra")]


@pytest.mark.parametrize("pair", PAIRS)
def test_pairs_by_outcome_are_answered_by_every_method(pair):
    cells = pairs_by_outcome(np.random.default_rng(0), pair, 200, 20)
    assert [outcome for outcome, _, _ in cells] == ["collision", "non-collision"]
    for outcome, a, b in cells:
        assert len(a) == len(b) == 200
        for method in ("abfme", "sat", "auto"):
            assert (overlap(a, b, method).hit == (outcome == "collision")).all()


def test_the_bracket_of_a_falling_cube_holds_the_time_that_geometry_says():
    cube = Boxes(np.zeros((2, 3)), np.full((2, 3), 0.5), np.tile(np.eye(3), (2, 1, 1)))
    pose = np.tile(np.eye(4), (2, 1, 1))
    pose[:, 2, 3] = 2.0
    rest = Motion(np.tile(np.eye(4), (2, 1, 1)), np.zeros((2, 3)), np.zeros((2, 3)))
    fall = Motion(pose, [[0, 0, -4.0], [0, 0, 4.0]], np.zeros((2, 3)))
    early, touch = bracket(cube, cube, rest, fall)
    assert early[0] <= 0.25 <= touch[0]
    assert touch[0] - early[0] < 1e-10
    assert np.isinf(early[1])
    assert np.isinf(touch[1])


def test_a_wrong_time_of_impact_would_show():
    early, touch = np.array([0.3, 0.5, np.inf, np.inf]), np.array([0.3, 0.5, np.inf, np.inf])
    row = impact_errors(early, touch, np.array([0.3 + 1e-6, np.inf, np.inf, 0.2]))
    assert [row[name]["value"] for name in ("missed", "false", "late")] == [0.5, 0.5, 0.5]
    assert row["toi_error_max"] == pytest.approx(1e-6)


@pytest.mark.parametrize("kind", ["boxes", "tetrahedra"])
def test_moving_bodies_are_never_late_never_missed_and_close(kind):
    given = moving_pairs(np.random.default_rng(4), kind, 300)
    row = impact_errors(*bracket(*given), time_of_impact(*given).time_of_impact)
    assert row["hits"] > 10
    assert [row[name]["value"] for name in ("missed", "false", "late")] == [0, 0, 0]
    assert row["toi_error_max"] <= 1e-7


def test_cached_planes_answer_most_frames_as_fresh_ones_do():
    rng, n = np.random.default_rng(3), 300
    a, b = (Tetrahedra(rng.uniform(-1, 1, (n, 4, 3))) for _ in range(2))
    velocity, cache = rng.normal(0, 0.01, (n, 3)), PlaneCache(n)
    for frame in range(3):
        moved = shifted(b, 0.8 + frame * velocity)
        hit = cache.overlap(a, moved).hit
        np.testing.assert_array_equal(hit, overlap(a, moved, "auto").hit)
    assert cache.answered > 0.8 * (~hit).sum()


def test_a_batch_of_one_stands_for_every_row():
    one = Motion(np.eye(4), np.ones(3), np.zeros(3))
    assert len(take(one, np.arange(5))) == 5


def test_an_error_between_points_without_extent_is_a_number():
    truth, size = np.zeros(2), np.array([0.0, 2.0])
    assert relative_error(np.array([0.0, 0.5]), truth, size) == 0.25
    assert relative_error(np.array([1e-300, 0.5]), truth, size) == np.inf


def test_the_size_of_a_volume_is_that_of_geometry():
    cube = np.array(
        [[[x, y, z] for z in (-1.0, 1.0)] + [[x, y, 0.0]] for x in (-1, 1) for y in (-1, 1)]
    )
    expected = {"sphere": 4 / 3 * np.pi * 3**1.5, "aabb": 8.0, "k_dop": 8.0}
    for name, value in expected.items():
        volume = VOLUMES[name](cube, np.array([0, 4]))
        volume.fit()
        numbers = np.empty((1, volume.numbers))
        volume.write(numbers)
        assert enclosed(name, numbers[0]) == pytest.approx(value)
    assert HullVolumes(cube, np.array([0, 4])).size[0] == pytest.approx(8.0)
