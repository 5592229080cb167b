"""A hundred thousand pairs of each two kinds, one of them curved, beside bounds from NumPy."""

import itertools

import numpy as np
import pytest

from oracles.curved_bodies import CURVED, NAMES, Sets, errors_of
from tauguard.rigid import HalfSpaces, distance

pytestmark = pytest.mark.slow
PAIRS = [p for p in itertools.combinations_with_replacement(NAMES, 2) if set(p) & set(CURVED)]


@pytest.mark.parametrize("kinds", PAIRS, ids="-".join)
def test_bounds(kinds, slow_seed):
    worst, overlapping = np.zeros(4), 0
    for part in range(10):
        rng = np.random.default_rng([slow_seed, part])
        a, b = (Sets(kind, rng, 10_000, spread=[0.3, 1, 3][part % 3]) for kind in kinds)
        got = distance(a.bodies(), b.bodies())
        worst = np.maximum(worst, errors_of(a, b, got, searched=300).max(axis=1))
        overlapping += int((got.distance <= 0).sum())
    print(f"{'-'.join(kinds)}: 100000 pairs, {overlapping} overlap, errors {worst}")
    assert worst[[0, 2, 3]].max() <= 1e-9
    assert worst[1] <= 1e-8  # of the points


@pytest.mark.parametrize("kind", NAMES)
def test_half_spaces(kind, slow_seed):
    rng, n = np.random.default_rng(slow_seed), 100_000
    body, normal = Sets(kind, rng, n), rng.normal(size=(n, 3))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    offset = rng.uniform(-2, 2, n)
    got = distance(HalfSpaces(normal, offset), body.bodies()).distance
    want = -body.height(-normal[:, None])[:, 0] - offset
    size = np.linalg.norm(body.center, axis=1) + np.linalg.norm(body.size, axis=1)
    worst = (np.abs(got - want) / size).max()
    print(f"half-spaces-{kind}: 100000 pairs, {(got <= 0).sum()} overlap, error {worst:.1e}")
    assert worst <= 3e-14
