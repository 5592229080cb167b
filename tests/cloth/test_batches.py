"""The batched narrow phase: every variant the same bits, and no query sees its neighbours."""

import numpy as np
import pytest

from tauguard.cloth import _mesh, edge_edge, vertex_face

QUERIES = {"vf": vertex_face, "ee": edge_edge}
FIELDS = ("hit", "toi", "point", "normal", "weights")


def queries(seed):
    """Random, flat, lattice, thin and far-off queries, in random order."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(5_000, 2, 4, 3))
    x[1000:2000, :, :, 2] *= 1e-6
    x[2000:3000] = rng.integers(-2, 3, size=(1000, 2, 4, 3))
    x[3000:4000, 1] = x[3000:4000, 0] + 1e-3 * x[3000:4000, 1]
    x[4000:4500] *= 10.0 ** rng.integers(-200, 200, size=(500, 1, 1, 1))
    x[4500:] += 1e6
    return rng.permutation(x)


@pytest.fixture
def fastest_after():
    yield
    _mesh.force_batch_kernels("")


@pytest.mark.parametrize("kind", QUERIES)
def test_every_variant_gives_the_same_bits(kind, fastest_after):
    x = queries(0)
    assert _mesh.force_batch_kernels("portable")
    portable = QUERIES[kind](x[:, 0], x[:, 1])
    assert 200 < portable.hit.sum() < 4_000
    for name in ("avx2", ""):
        if not _mesh.force_batch_kernels(name) and name:
            continue
        fast = QUERIES[kind](x[:, 0], x[:, 1])
        for field in FIELDS:
            assert getattr(portable, field).tobytes() == getattr(fast, field).tobytes(), field


@pytest.mark.parametrize("kind", QUERIES)
def test_a_query_does_not_depend_on_its_neighbours(kind):
    x = queries(1)
    order = np.random.default_rng(2).permutation(len(x))[:1_717]
    whole, part = QUERIES[kind](x[:, 0], x[:, 1]), QUERIES[kind](x[order, 0], x[order, 1])
    for field in FIELDS:
        assert getattr(whole, field)[order].tobytes() == getattr(part, field).tobytes(), field


@pytest.mark.parametrize("kind", QUERIES)
def test_batches_agree_with_exact_arithmetic(kind):
    x = queries(3)
    ours = QUERIES[kind](x[:, 0], x[:, 1])
    exact = QUERIES[kind](x[:, 0], x[:, 1], method="exact")
    assert np.array_equal(ours.hit, exact.hit)
    early = exact.toi[exact.hit] - ours.toi[exact.hit]
    assert early.min() >= 0
    assert early.max() <= 1e-9  # of the step
