"""Groups of windows, which the judge's classifiers keep in one fold."""

import numpy as np
import pytest

from tauguard.twin.judge import ALIKE, APART, FOLDS, GROUP, REPEATED, _groups


def brute_force(place, logs, starts):
    """As :func:`_groups` says, with all distances."""
    groups = np.empty(len(place), dtype=np.int64)
    for i, here in enumerate(place):
        far = np.linalg.norm(place - here, axis=1)
        far[(logs == logs[i]) & (np.abs(starts - starts[i]) <= APART)] = np.inf
        before = int(np.argmin(far[:i])) if i else 0
        if i and far[before] < ALIKE:
            groups[i] = groups[before]
            continue
        repeated = bool((far < ALIKE).any())
        length = REPEATED if repeated else GROUP
        groups[i] = 2 * (100_000 * logs[i] + int(starts[i] / length)) + repeated
    few = len(np.unique(groups)) < FOLDS
    return 100_000 * logs + (starts / GROUP).astype(np.int64) if few else groups


def wandering(rng, count):
    return np.cumsum(rng.normal(0, 0.5, (count, 6)), axis=0)


def repeating(rng, count):
    """A cycle of 6 s."""
    angle = 2 * np.pi * 0.2 * np.arange(count)[:, None] / 6 + np.arange(6)
    return 4 * np.sin(angle) + rng.normal(0, 0.2, (count, 6))


def standing(rng, count):
    """Few poses, held for 10 s each; a window in ten has noise."""
    poses = rng.uniform(-5, 5, (8, 6))[rng.integers(8, size=count // 50 + 1)]
    return np.repeat(poses, 50, axis=0)[:count] + (rng.random((count, 1)) < 0.1) * 0.01


def one_place(rng, count):
    return rng.normal(0, 0.1, (count, 6))


@pytest.mark.parametrize("motion", [wandering, repeating, standing, one_place])
@pytest.mark.parametrize("seed", range(5))
def test_groups_are_those_of_all_distances(motion, seed):
    rng = np.random.default_rng(seed)
    counts = [1, *rng.integers(30, 300, size=3)]
    place = np.concatenate([motion(rng, count) for count in counts])
    logs = np.repeat(np.arange(len(counts)), counts)
    starts = np.concatenate([0.2 * np.arange(count) for count in counts])
    kept = rng.random(len(place)) < 0.8  # windows in which other joints move are missing
    given = place[kept], logs[kept], starts[kept]
    np.testing.assert_array_equal(_groups(*given), brute_force(*given))


def test_no_window_and_one():
    assert len(_groups(np.empty((0, 6)), np.empty(0, dtype=np.int64), np.empty(0))) == 0
    assert _groups(np.zeros((1, 6)), np.array([2]), np.array([7.0])).tolist() == [200_001]
