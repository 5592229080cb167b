"""The points of the weights on both features coincide with the point of contact."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from oracles.adversarial_queries import KINDS as ADVERSARIAL
from oracles.touching_pairs import KINDS, gap_of_weights, touching
from tauguard.cloth import METHODS, MeshCCD, edge_edge, point_edge, vertex_face

integers = hnp.arrays(np.float64, (2, 4, 3), elements=st.integers(-2, 2).map(float))
thirds = integers.map(lambda x: x / 3)
flat = integers.map(lambda x: x * np.array([1, 1, 0]))
line = integers.map(lambda x: x[:, :, :1] * np.array([1, 2, -1]))


def assert_coincide(vertex, x_t0, x_t1, impacts):
    hit = impacts.hit
    weights = impacts.weights[hit]
    first = 1 if vertex else 2
    assert (weights >= 0).all()
    for part in (slice(0, first), slice(first, None)):
        np.testing.assert_allclose(weights[:, part].sum(axis=1), 1, rtol=0, atol=2**-51)
    gap, bound = gap_of_weights(
        vertex, x_t0[hit], x_t1[hit], impacts.toi[hit], impacts.point[hit], weights
    )
    worst = np.argmax(gap - bound) if len(gap) else 0
    assert (gap <= bound).all(), (x_t0[hit][worst], x_t1[hit][worst], gap[worst])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("exponent", [0, -900, 900])
def test_degenerate_pairs_that_touch(kind, method, exponent):
    vertex, x_t0, x_t1 = touching(kind, 0, 200 if exponent == 0 else 20)
    query = vertex_face if vertex else edge_edge
    impacts = query(np.ldexp(x_t0, exponent), np.ldexp(x_t1, exponent), method)
    assert impacts.hit.all()
    impacts.point[:] = np.ldexp(impacts.point, -exponent)
    assert_coincide(vertex, x_t0, x_t1, impacts)


@pytest.mark.parametrize("offset", [1.0, 1e6])
@pytest.mark.parametrize("kind", KINDS)
def test_degenerate_pairs_far_from_the_origin(kind, offset):
    vertex, x_t0, x_t1 = touching(kind, 1, 1000)
    x_t0, x_t1 = x_t0 + offset, x_t1 + offset
    assert_coincide(vertex, x_t0, x_t1, (vertex_face if vertex else edge_edge)(x_t0, x_t1))


@pytest.mark.parametrize("vertex", [True, False])
@pytest.mark.parametrize("positions", [integers, thirds, flat, line])
def test_any_contact(positions, vertex):
    @settings(deadline=None, max_examples=100)
    @given(positions)
    def check(x):
        for method in METHODS:
            impacts = (vertex_face if vertex else edge_edge)(x[:1], x[1:], method)
            assert_coincide(vertex, x[:1], x[1:], impacts)

    check()


@pytest.mark.parametrize("vertex", [True, False])
@pytest.mark.parametrize("name", ADVERSARIAL)
def test_adversarial_contacts(name, vertex):
    x = ADVERSARIAL[name](np.random.default_rng(4), 300, vertex)
    impacts = (vertex_face if vertex else edge_edge)(x[:, 0], x[:, 1])
    assert_coincide(vertex, x[:, 0], x[:, 1], impacts)


def test_parallel_edges_meet_in_the_middle_of_their_overlap():
    start = np.array([[[0, 0, 1], [4, 0, 1], [1, 0, 0], [9, 0, 0.0]]])
    end = start * [1, 1, 0]
    start, end = start.repeat(3, axis=0), end.repeat(3, axis=0)
    start[1], end[1] = start[1, [0, 1, 3, 2]], end[1, [0, 1, 3, 2]]  # opposite direction
    start[2], end[2] = start[2, [2, 3, 0, 1]], end[2, [2, 3, 0, 1]]
    impacts = edge_edge(start, end)
    np.testing.assert_allclose(impacts.point[:, :2], [[2.5, 0]] * 3, atol=1e-15)
    assert (impacts.normal == 0).all()
    # 2.5 = 4 * 5/8 = 1 + 8 * 3/16
    np.testing.assert_allclose(impacts.weights[0], [3 / 8, 5 / 8, 13 / 16, 3 / 16], atol=1e-15)
    np.testing.assert_allclose(impacts.weights[1], [3 / 8, 5 / 8, 3 / 16, 13 / 16], atol=1e-15)
    np.testing.assert_allclose(impacts.weights[2], [13 / 16, 3 / 16, 3 / 8, 5 / 8], atol=1e-15)


def test_edges_apart_by_the_minimum_distance_have_the_nearest_points():
    """Edges whose lines cross beyond both ends: the nearest points are an end and a foot."""
    start = np.array([[[0, 0, 1], [1, 0, 1], [2, -1, 0], [1.5, 1, 0.0]]])
    end = start.copy()
    end[:, :2] += [1.0, 0, -1]
    impacts = edge_edge(start, end, min_distance=0.25)
    x = start + impacts.toi[0] * (end - start)
    w = impacts.weights
    gap = np.linalg.norm(w[0, :2] @ x[0, :2] - w[0, 2:] @ x[0, 2:])
    assert impacts.hit[0]
    assert 0.24 < gap < 0.25 + 1e-6


@pytest.mark.parametrize("vertex", [True, False])
def test_normals_follow_the_order_of_the_vertices(vertex):
    x = np.random.default_rng(6).normal(size=(2000, 2, 4, 3))
    found = (vertex_face if vertex else edge_edge)(x[:, 0], x[:, 1])
    at = x[:, 0] + found.toi.clip(0, 1)[:, None, None] * (x[:, 1] - x[:, 0])
    a, b, c, d = at[found.hit].transpose(1, 0, 2)
    wanted = np.cross(c - b, d - b) if vertex else np.cross(b - a, d - c)
    wanted /= np.linalg.norm(wanted, axis=1, keepdims=True)
    assert found.hit.sum() > 100
    np.testing.assert_allclose(found.normal[found.hit], wanted, atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_frames_describe_as_single_queries_do(kind):
    """Pairs that share no vertex, far from each other, in one mesh."""
    vertex, x_t0, x_t1 = touching(kind, 2, 50)
    apart = 64.0 * np.arange(50)[:, None, None] * np.array([1, 0, 0])
    x_t0, x_t1 = x_t0 + apart, x_t1 + apart
    rows = np.arange(200).reshape(50, 4)
    ccd = (
        MeshCCD(rows[:, 1:], points=rows[:, 0])
        if vertex
        else MeshCCD(np.zeros((0, 3), int), edges=rows.reshape(-1, 2))
    )
    frame = ccd.find(x_t0.reshape(-1, 3), x_t1.reshape(-1, 3))
    pairs, of_mesh = (frame.vf, frame.vf_impacts) if vertex else (frame.ee, frame.ee_impacts)
    order = np.argsort(pairs[:, 1] if vertex else pairs[:, 0])
    single = (vertex_face if vertex else edge_edge)(x_t0, x_t1)
    assert len(order) == 50
    for name in ("toi", "point", "normal", "weights"):
        np.testing.assert_array_equal(getattr(of_mesh, name)[order], getattr(single, name))


def test_a_point_and_an_edge():
    at = touching("end on edge", 3, 500)
    x_t0, x_t1 = (x[:, [0, 2, 3]] for x in at[1:])
    impacts = point_edge(x_t0, x_t1)
    assert impacts.hit.all()
    x = x_t0 + impacts.toi[:, None, None] * (x_t1 - x_t0)
    on_edge = np.einsum("nk,nkj->nj", impacts.weights[:, 1:], x[:, 1:])
    assert np.abs(on_edge - impacts.point).max() < 1e-7
    assert np.array_equal(x[:, 0], impacts.point)
