"""Whole frames: every collision of a mesh, against all pairs asked one by one and against truth."""

import copy

import numpy as np
import pytest
from hypothesis import given, settings

from oracles import all_pairs
from oracles.recorded_collisions import load_frame
from tauguard.cloth import Impacts, MeshCCD, edge_edge, vertex_face
from tauguard.cloth.comparators import METHODS, ComparedMeshCCD, solve
from tauguard.cloth.scenes import SCENES
from tests.cloth.test_candidates import as_set, sheet, small_meshes
from tests.cloth.test_topology import split_face, tear

FIELDS = ("hit", "toi", "point", "normal", "weights")


def one_by_one(faces, x_t0, x_t1, method="ab2pf", min_distance=0.0):
    """Every query of the mesh, without a broad phase."""
    vf, vf_rows, ee, ee_rows = all_pairs.queries(faces)
    vf_hit = vertex_face(x_t0[vf_rows], x_t1[vf_rows], method=method, min_distance=min_distance).hit
    ee_hit = edge_edge(x_t0[ee_rows], x_t1[ee_rows], method=method, min_distance=min_distance).hit
    return vf[vf_hit], ee[ee_hit]


def answers(vertex, x_t0, x_t1, rows, method):
    """Each query with positions of its own, by any narrow phase."""
    n = len(rows)
    hit = np.zeros(n, dtype=np.uint8)
    out = [np.full(n, np.inf), *(np.full((n, k), np.nan) for k in (3, 3, 4))]
    start, end = x_t0[rows].reshape(-1, 3), x_t1[rows].reshape(-1, 3)
    own = np.arange(4 * n, dtype=np.int32).reshape(-1, 4)
    solve(vertex, start, end, own, method, hit, *out)
    return Impacts(hit.astype(bool), *out)


def assert_same(a, b):
    assert np.array_equal(a.vf, b.vf)
    assert np.array_equal(a.ee, b.ee)
    for kind in ("vf_impacts", "ee_impacts"):
        for field in FIELDS:
            x, y = (getattr(getattr(f, kind), field) for f in (a, b))
            assert x.tobytes() == y.tobytes(), (kind, field)


def test_two_frames_can_be_compared():
    """By identity: arrays have no one truth value."""
    scene = SCENES["pleats"](1_000, 0)
    a, b = (MeshCCD(scene.faces).find(*next(scene.steps(5))) for _ in range(2))
    assert a == a
    assert a != b
    assert a.vf_impacts != b.vf_impacts
    assert_same(a, b)


@settings(deadline=None, max_examples=30)
@given(small_meshes())
def test_any_small_mesh_has_the_collisions_of_all_pairs(mesh):
    """Lattice positions: touching, coplanar, degenerate faces and edges of no length abound."""
    faces, x_t0, x_t1 = mesh
    frame = MeshCCD(faces).find(x_t0, x_t1)
    vf, ee = one_by_one(faces, x_t0, x_t1)
    assert as_set(frame.vf) == as_set(vf)
    assert as_set(frame.ee) == as_set(ee)


@pytest.mark.parametrize("volume", ["aabb", "k_dop18", "moving_k_dop6", "moving_k_dop26"])
@pytest.mark.parametrize("offset", [0.0, 1e6])
def test_folded_sheet_has_the_collisions_of_all_pairs(volume, offset):
    faces, x_t0, x_t1 = sheet(8, np.random.default_rng(0))
    x_t0, x_t1 = x_t0 + offset, x_t1 + offset
    frame = MeshCCD(faces, volume=volume).find(x_t0, x_t1)
    vf, ee = one_by_one(faces, x_t0, x_t1)
    assert len(vf) > 5
    assert len(ee) > 5
    assert np.array_equal(frame.vf, vf)
    assert np.array_equal(frame.ee, ee)


@pytest.mark.parametrize("method", METHODS)
def test_impacts_are_those_of_single_queries(method):
    faces, x_t0, x_t1 = sheet(8, np.random.default_rng(1))
    ccd = ComparedMeshCCD(faces, method)
    frame = ccd.find(x_t0, x_t1)
    vf_rows = np.concatenate([frame.vf[:, :1], faces[frame.vf[:, 1]]], axis=1)
    ee_rows = np.concatenate([ccd.edges[frame.ee[:, 0]], ccd.edges[frame.ee[:, 1]]], axis=1)
    assert len(vf_rows) > 5
    assert len(ee_rows) > 5
    one_by_one = (
        answers(True, x_t0, x_t1, vf_rows, method),
        answers(False, x_t0, x_t1, ee_rows, method),
    )
    for have, want in zip((frame.vf_impacts, frame.ee_impacts), one_by_one, strict=True):
        for field in FIELDS:
            assert np.array_equal(getattr(have, field), getattr(want, field)), field
        assert have.hit.all()


@pytest.mark.parametrize("distance", [1e-3, 0.03])
def test_min_distance_finds_what_comes_close(distance):
    faces, x_t0, x_t1 = sheet(8, np.random.default_rng(2))
    frame = MeshCCD(faces).find(x_t0, x_t1, min_distance=distance)
    touching = MeshCCD(faces).find(x_t0, x_t1)
    vf, ee = one_by_one(faces, x_t0, x_t1, "ab2pf", distance)
    assert as_set(touching.vf) < as_set(frame.vf)
    # The query is conservative: what all pairs find and the volumes rule out is further away.
    assert as_set(frame.vf) <= as_set(vf)
    assert as_set(frame.ee) <= as_set(ee)
    _, vf_rows, _, ee_rows = all_pairs.queries(faces)
    for found, pairs, rows, split in (
        (frame.vf, all_pairs.queries(faces)[0], vf_rows, 1),
        (frame.ee, all_pairs.queries(faces)[2], ee_rows, 2),
    ):
        near = all_pairs.axis_distance(x_t0, x_t1, rows, split, 26, True) <= distance
        hits = as_set(vf if split == 1 else ee)
        assert as_set(pairs[near]) & hits <= as_set(found)


def test_any_thread_count_gives_the_same_bits():
    scene = SCENES["crumpling"](6_000, 0)
    *_, step = scene.steps(30)
    one = MeshCCD(scene.faces, threads=1).find(*step)
    assert len(one.vf) > 100
    for threads in (2, 5):
        assert_same(one, MeshCCD(scene.faces, threads=threads).find(*step))


@pytest.mark.parametrize("name", SCENES)
def test_front_kept_over_a_scene_equals_fresh(name):
    scene = SCENES[name](1_500, 0)
    kept = MeshCCD(scene.faces, groups=scene.groups)
    hits = []
    for step in scene.steps(40):
        frame = kept.find(*step)
        hits.append(len(frame.vf) + len(frame.ee))
        assert_same(frame, MeshCCD(scene.faces, groups=scene.groups).find(*step, fresh=True))
    assert max(hits) > 10
    assert min(hits) < max(hits) / 4


def test_topology_updates_equal_a_new_mesh():
    rng = np.random.default_rng(3)
    faces, *x = sheet(12, rng)
    ccd = MeshCCD(faces)
    ccd.find(*x)
    for i in range(12):
        if i % 3 == 0:
            faces = np.delete(faces, rng.integers(len(faces), size=4), axis=0)
        elif i % 3 == 1:
            faces, x = tear(faces, x, int(faces[rng.integers(len(faces)), 0]))
        else:
            faces, x = split_face(faces, x, int(rng.integers(len(faces))))
        ccd.update_topology(faces)
        frame = ccd.find(*x)
        assert_same(frame, MeshCCD(faces).find(*x))
        assert len(frame.ee) > 5


def test_statistics_add_up():
    faces, x_t0, x_t1 = sheet(20, np.random.default_rng(4))
    ccd = MeshCCD(faces)
    frame = ccd.find(x_t0, x_t1)
    candidates = ccd.candidates(x_t0, x_t1)
    for counts, hits, pairs in zip(
        (frame.stats.vf, frame.stats.ee), (frame.vf, frame.ee), candidates, strict=True
    ):
        assert counts["candidates"] == len(pairs)
        assert counts["hits"] == len(hits)
    assert set(frame.stats.seconds) >= {
        "project",
        "build",
        "refit",
        "traverse",
        "vf",
        "ee",
        "total",
    }
    assert frame.stats.seconds["total"] >= sum(
        frame.stats.seconds[part] for part in ("project", "build", "refit", "traverse", "vf", "ee")
    )
    assert 50 < frame.stats.bytes / len(faces) < 5_000


def test_answers_that_are_kept_stay_though_memory_of_others_is_used_again():
    rng = np.random.default_rng(6)
    faces, x_t0, x_t1 = sheet(20, rng)
    ccd, kept, copies = MeshCCD(faces), [], []
    for number in range(12):
        frame = ccd.find(x_t0, x_t1 + rng.normal(scale=1e-3, size=x_t1.shape))
        if number % 3 == 0:  # of the others the memory is free again
            kept.append(frame)
            copies.append(copy.deepcopy(frame))
    del ccd  # answers outlive the mesh
    for frame, before in zip(kept, copies, strict=True):
        assert len(frame.vf) > 5
        assert_same(frame, before)


def test_method_is_named():
    with pytest.raises(ValueError, match="method 'magic': expected one of "):
        MeshCCD([[0, 1, 2]], "magic")


def test_nothing_to_find():
    frame = MeshCCD([]).find(np.zeros((3, 3)), np.ones((3, 3)))
    assert frame.vf.shape == frame.ee.shape == (0, 2)
    assert len(frame.vf_impacts.toi) == 0


@pytest.mark.data
@pytest.mark.parametrize("name", ["cloth-funnel", "cloth-ball"])
def test_real_frames_have_exactly_the_listed_collisions(data_dir, name):
    scene = load_frame(data_dir, name)
    frame = MeshCCD(scene.faces).find(scene.x_t0, scene.x_t1)
    assert np.array_equal(frame.vf, scene.hits[0])
    assert np.array_equal(frame.ee, scene.hits[1])
