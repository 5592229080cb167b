"""The batched narrow phase: every variant the same bits, and no query sees its neighbours."""

import numpy as np
import pytest

from tauguard.cloth import _mesh, edge_edge, vertex_face
from tests.cloth.solve import solve, solve_each

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


@pytest.mark.parametrize("kind", QUERIES)
def test_queries_apart_on_an_axis_are_left_out_and_no_others(kind):
    x = queries(4)
    x[::2, :, :, 1] = np.abs(x[::2, :, :, 1])  # on one side of a plane: apart, or nearly
    x[::2, :, 0, 1] *= -1
    if kind == "ee":
        x[::2, :, 1, 1] *= -1
    a, b = (x[:, :, :1], x[:, :, 1:]) if kind == "vf" else (x[:, :, :2], x[:, :, 2:])
    above, below = ((lo.min(axis=2) > hi.max(axis=2)).all(axis=1) for lo, hi in ((a, b), (b, a)))
    apart = (above | below).any(axis=1)
    ours, exact = (solve_each(kind == "vf", x, method) for method in ("ab2pf", "exact"))
    assert ours.counts["axes"] == apart.sum() > 1_000
    assert np.array_equal(ours.hit, exact.hit)
    assert not exact.hit[apart].any()


@pytest.mark.parametrize("kind", QUERIES)
@pytest.mark.parametrize(
    "scene", ["soft", "flat", "brink", "lattice", "far", "tiny", "huge", "uneven", "wide"]
)
def test_long_lists_on_shared_positions_are_answered_alike(kind, scene, fastest_after):
    """They are seen from seven axes in float32 first: no bit of an answer may tell."""
    rng = np.random.default_rng(5)
    x = rng.normal(size=(2, 300, 3))
    x[1] = x[0] + rng.uniform(0, 1, size=(300, 1)) * x[1]
    if scene == "flat":  # apart by less than float32 can tell, or not at all
        x[:, :, 2] *= 1e-8
    if scene == "brink":  # apart by about what float32 can just tell
        x[:, :, 2] = 2.0**-21 * np.round(4 * x[:, :, 2])
    if scene == "lattice":
        x = np.round(x)
    sizes = {"tiny": 1e-290, "huge": 1e290, "uneven": [2.0**300, 1, 2.0**-300]}
    x = (1e10 if scene == "far" else 0.0) + np.asarray(sizes.get(scene, 1.0)) * x
    if scene == "wide":
        x[:, 0] = 1e200
    rows = rng.permuted(np.tile(np.arange(300, dtype=np.int32), (6_000, 1)), axis=1)[:, :4].copy()
    plain = QUERIES[kind](x[0, rows], x[1, rows])
    assert plain.hit.any()
    assert not plain.hit.all()
    counts = []
    for name in ("portable", "avx2", ""):
        if not _mesh.force_batch_kernels(name) and name:
            continue
        ours = solve(kind == "vf", x[0], x[1], rows)
        counts.append(ours.counts)
        assert np.array_equal(ours.hit, plain.hit)
        assert ours.toi[ours.hit].tobytes() == plain.toi[plain.hit].tobytes()
    assert all(found == counts[0] for found in counts)
    assert (counts[0]["axes"] > 1_000) == (scene != "wide")
