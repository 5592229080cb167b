"""Coherent frames: cached planes change the time of an answer, never the answer."""

import numpy as np
import pytest

from oracles.convex_bodies import HARD, KINDS
from tauguard.rigid import Hulls, PlaneCache, Tetrahedra, overlap
from tauguard.rigid.queries import native_overlap


@pytest.mark.parametrize("kind", ["tetrahedra", "hulls"])
def test_frames_of_moving_bodies(kind):
    rng = np.random.default_rng(3)
    n = 800
    a, b = (KINDS["tetrahedra"](rng, n).vertices for _ in range(2))
    b = b + rng.uniform(-1, 1, (n, 1, 3))
    velocity = rng.normal(0, 0.01, (n, 1, 3))
    cache = PlaneCache(n)
    for frame in range(8):
        moved = b + frame * velocity
        x, y = (
            (Hulls(v.reshape(-1, 3), 4 * np.arange(n + 1)) for v in (a, moved))
            if kind == "hulls"
            else (Tetrahedra(a), Tetrahedra(moved))
        )
        hit = cache.overlap(x, y).hit
        np.testing.assert_array_equal(hit, native_overlap(x, y, "exact")[0])
        if frame:
            assert cache.answered > 0.85 * (~hit).sum()
        else:
            assert cache.answered == 0


@pytest.mark.parametrize("name", ["grid", "grid boxes and tetrahedra", "touching boxes", "flat"])
def test_contact_is_never_taken_for_a_gap(name):
    a, b = HARD[name](np.random.default_rng(4), 400)
    cache = PlaneCache(400)
    for _ in range(2):
        np.testing.assert_array_equal(cache.overlap(a, b).hit, overlap(a, b).hit)


def test_threads_change_nothing():
    rng = np.random.default_rng(5)
    a, b = KINDS["boxes"](rng, 5000), KINDS["tetrahedra"](rng, 5000)
    caches = [PlaneCache(5000) for _ in range(3)]
    for _ in range(2):
        hits = [c.overlap(a, b, threads=t).hit for c, t in zip(caches, (1, 2, 5), strict=True)]
        for hit in hits[1:]:
            np.testing.assert_array_equal(hit, hits[0])
    assert len({cache.answered for cache in caches}) == 1


def test_another_number_of_pairs_is_refused():
    body = Tetrahedra(np.zeros((3, 4, 3)))
    with pytest.raises(ValueError, match="a, b: 3 pairs, expected 2"):
        PlaneCache(2).overlap(body, body)
