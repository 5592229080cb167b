"""Points and edges of no face: queries against rational arithmetic, frames against all pairs."""

import itertools

import numpy as np
import pytest

from oracles.point_contact import point_edge_time, point_point_time
from tauguard.cloth import Groups, MeshCCD, edge_edge, point_edge, point_point, vertex_face
from tauguard.cloth.comparators import ComparedMeshCCD

KINDS = {"pe": (point_edge, 3, point_edge_time), "pp": (point_point, 2, point_point_time)}


def lattice(rng, n, corners):
    """Small integers, so that a share of the queries touch; and powers of two."""
    x = rng.integers(-2, 3, size=(n, 2, corners, 3)).astype(float)
    x[::3, :, :, 2] = 1  # in a plane
    x[::5, :, :, 1:] = 0  # on a line
    if corners == 3:
        x[::7, :, 2] = x[::7, :, 1]  # an edge without length
    return x, 2.0 ** rng.integers(-200, 200, size=(n, 1, 1, 1))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("method", ["ab2pf", "exact"])
def test_hits_and_times_are_those_of_rational_arithmetic(kind, method):
    query, corners, truth = KINDS[kind]
    x, scale = lattice(np.random.default_rng(3), 900, corners)
    ours = query((x * scale)[:, 0], (x * scale)[:, 1], method=method)
    times = np.array([truth(*row) for row in x], dtype=float)
    assert np.array_equal(ours.hit, np.isfinite(times))
    assert 60 < ours.hit.sum() < 700
    early = times[ours.hit] - ours.toi[ours.hit]
    assert early.min() >= -1e-15  # the truth itself is rounded
    assert early.max() <= 1e-9


@pytest.mark.parametrize("kind", KINDS)
def test_meetings_by_construction_are_found_and_a_bit_beside_them_are_not(kind):
    query, corners, _ = KINDS[kind]
    rng = np.random.default_rng(4)
    n = 400
    t, s = rng.integers(1, 64, size=n) / 64, rng.integers(0, 65, size=n) / 64
    x = rng.integers(-(2**20), 2**20, size=(2, n, corners, 3)).astype(float)
    x[:, :, 1:] *= 4096  # the point's end comes out exactly
    meet = (1 - t)[:, None, None] * x[0] + t[:, None, None] * x[1]
    at = meet[:, 1] if corners == 2 else meet[:, 1] + s[:, None] * (meet[:, 2] - meet[:, 1])
    away = rng.integers(-(2**20), 2**20, size=(n, 3)).astype(float)
    x[0, :, 0], x[1, :, 0] = at - t[:, None] * away, at + (1 - t)[:, None] * away
    hit = query(*x)
    assert hit.hit.all()
    assert np.all(hit.toi <= t)
    np.testing.assert_allclose(hit.point, at, atol=1e-2)
    np.testing.assert_allclose(hit.weights.sum(axis=1), 2)
    x[:, :, 0] += 2.0**-12
    assert query(*x).hit.mean() < 0.02


@pytest.mark.parametrize("kind", KINDS)
def test_a_minimum_distance_is_conservative(kind):
    query, corners, _ = KINDS[kind]
    x0 = np.zeros((1, corners, 3))
    x0[0, 1:, 1] = [-1, 1][: corners - 1] if corners == 3 else 0
    x0[0, 0] = [5, 0, 0]
    x1 = x0.copy()
    x1[0, 0, 0] = 0.5
    assert not query(x0, x1).hit[0]
    assert not query(x0, x1, min_distance=0.499).hit[0]
    near = query(x0, x1, min_distance=1.0)
    assert near.hit[0]
    assert 0.88 < near.toi[0] <= 4 / 4.5


@pytest.mark.parametrize("query", [point_edge, point_point])
def test_other_methods_and_bad_shapes_are_refused(query):
    n = 3 if query is point_edge else 2
    with pytest.raises(ValueError, match="expected one of ab2pf, exact"):
        query(np.zeros((1, n, 3)), np.zeros((1, n, 3)), method="vcd")
    with pytest.raises(ValueError, match="x_t0: shape"):
        query(np.zeros((1, 4, 3)), np.zeros((1, 4, 3)))
    with pytest.raises(ValueError, match="finite"):
        query(np.full((1, n, 3), np.nan), np.zeros((1, n, 3)))
    assert len(query(np.zeros((0, n, 3)), np.zeros((0, n, 3))).hit) == 0


def parts(rng):
    """Two triangles, a loop of rods, five particles; crowded on a lattice."""
    faces = np.array([[0, 1, 2], [2, 1, 3]])
    rods = np.array([[4, 5], [6, 5], [6, 7], [1, 4], [1, 2]])  # the last is an edge of a face
    points = np.array([8, 9, 10, 11, 12, 3, 5])  # two are of a face and of a rod
    x = rng.integers(-1, 2, size=(2, 13, 3)).astype(float)
    return faces, rods, points, x


def all_pairs(faces, edges, rods, points, used, x, **kw):
    """Every pair by single queries."""

    def hits(rows, query, corners):
        rows = [r for r in rows if len(set(corners(r))) == len(corners(r))]
        if not rows:
            return set()
        at = np.array([corners(r) for r in rows], dtype=int)
        return {r for r, h in zip(rows, query(x[0][at], x[1][at], **kw).hit, strict=True) if h}

    vf = hits(
        [(v, f) for v in used for f in range(len(faces))],
        vertex_face,
        lambda r: (r[0], *faces[r[1]]),
    )
    ee = hits(
        list(itertools.combinations(range(len(edges)), 2)),
        edge_edge,
        lambda r: (*edges[r[0]], *edges[r[1]]),
    )
    wires = [i for i, e in enumerate(edges.tolist()) if e in rods]
    pe = hits([(p, e) for p in points for e in wires], point_edge, lambda r: (r[0], *edges[r[1]]))
    pp = hits(list(itertools.combinations(points, 2)), point_point, lambda r: r)
    return vf, ee, pe, pp


def found(frame):
    return tuple(
        {tuple(r) for r in rows.tolist()} for rows in (frame.vf, frame.ee, frame.pe, frame.pp)
    )


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("volume", ["moving_k_dop14", "k_dop18"])
def test_frames_of_isolated_parts_have_every_pair(seed, volume):
    faces, rods, points, x = parts(np.random.default_rng(seed))
    ccd = MeshCCD(faces, volume=volume, edges=rods, points=points)
    assert ccd.points.tolist() == [8, 9, 10, 11, 12]
    isolated = [[1, 4], [4, 5], [5, 6], [6, 7]]
    assert all(e in ccd.edges.tolist() for e in isolated)
    truth = all_pairs(faces, ccd.edges, isolated, range(8, 13), range(13), x)
    assert found(ccd.find(*x)) == truth
    assert found(MeshCCD(faces, method="exact", edges=rods, points=points).find(*x)) == truth
    assert found(ccd.find(*x, fresh=True)) == truth


def test_the_frames_above_have_pairs_of_every_kind():
    counts = np.zeros(4, dtype=int)
    for seed in range(12):
        faces, rods, points, x = parts(np.random.default_rng(seed))
        frame = MeshCCD(faces, edges=rods, points=points).find(*x)
        counts += [len(pairs) for pairs in found(frame)]
    assert counts.min() > 10


def test_wires_and_particles_alone_and_changed():
    rng = np.random.default_rng(1)
    x = rng.integers(-1, 2, size=(2, 13, 3)).astype(float)
    rods = [[4, 5], [5, 6], [6, 7]]
    ccd = MeshCCD([], edges=rods, points=range(8, 13))
    none = np.zeros((0, 3), dtype=int)
    assert found(ccd.find(*x)) == all_pairs(none, ccd.edges, rods, range(8, 13), range(4, 13), x)
    ccd.update_topology([[0, 1, 2]], points=[8, 9])
    again = MeshCCD([[0, 1, 2]], edges=rods, points=[8, 9])
    assert found(ccd.find(*x)) == found(again.find(*x))
    assert np.array_equal(ccd.edges, again.edges)
    ccd.update_topology([[0, 1, 2]], edges=[], points=[])
    assert found(ccd.find(*x)) == found(MeshCCD([[0, 1, 2]]).find(*x))


def test_groups_keep_isolated_parts_apart():
    x = np.zeros((2, 3, 3))
    x[0, 0, 2], x[1, 0, 2], x[:, 1, 0], x[:, 2, 0] = 1, -1, -1, 1
    apart = Groups([0, 1, 1], [[True, False], [False, True]])
    meets = Groups([0, 1, 1], [[True, True], [True, True]])
    assert len(MeshCCD([], edges=[[1, 2]], points=[0], groups=apart).find(*x).pe) == 0
    frame = MeshCCD([], edges=[[1, 2]], points=[0], groups=meets).find(*x)
    assert frame.pe.tolist() == [[0, 0]]
    np.testing.assert_allclose(frame.pe_impacts.weights, [[1, 0.5, 0.5]])
    assert frame.first_time() == frame.pe_impacts.toi[0] <= 0.5
    with pytest.raises(ValueError, match="edges: row 0 has vertices of groups"):
        MeshCCD([], edges=[[0, 1]], groups=apart)


@pytest.mark.parametrize(
    ("kw", "message"),
    [
        ({"edges": [[1, 1]]}, "edges: row 0 is .*repeats a vertex"),
        ({"edges": [[0, -1]]}, "edges: index -1"),
        ({"edges": [[0, 1, 2]]}, "edges: shape"),
        ({"points": [[1]]}, "points: shape"),
        ({"points": [0.5]}, "points: dtype"),
        ({"points": [7], "method": "vcd"}, "method 'vcd': expected one of ab2pf, exact"),
    ],
)
def test_bad_isolated_parts_are_named(kw, message):
    with pytest.raises(ValueError, match=message):
        MeshCCD([[0, 1, 2]], **kw)


def test_positions_must_reach_to_every_isolated_part():
    x = np.zeros((4, 3))
    for kw, name in (({"edges": [[3, 9]]}, "edges: row"), ({"points": [9]}, "points: row")):
        with pytest.raises(ValueError, match=name):
            MeshCCD([[0, 1, 2]], **kw).find(x, x)


def test_comparators_have_no_queries_of_points():
    with pytest.raises(ValueError, match="points: not available with method 'vcd'; expected ab2pf"):
        ComparedMeshCCD([[0, 1, 2]], "vcd", points=[7])
    ccd = ComparedMeshCCD([[0, 1, 2]], "vcd")
    with pytest.raises(ValueError, match="points: not available with method 'vcd'; expected ab2pf"):
        ccd.update_topology([[0, 1, 2]], points=[7])
