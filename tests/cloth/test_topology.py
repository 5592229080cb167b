"""Cutting and tearing: a mesh that changes its faces answers like a new mesh of those faces."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from oracles import all_pairs
from tauguard.cloth import VOLUMES, Groups, MeshCCD
from tests.cloth.test_candidates import as_set, sheet


def assert_like_new(ccd, faces, x_t0, x_t1, groups=None):
    new = MeshCCD(faces, groups=groups, volume=ccd.volume)
    assert np.array_equal(new.edges, ccd.edges)
    assert np.array_equal(new.faces, ccd.faces)
    want, have = new.find(x_t0, x_t1), ccd.find(x_t0, x_t1)
    assert np.array_equal(want.vf, have.vf)
    assert np.array_equal(want.ee, have.ee)
    # Volumes that are apart by less than a step of 16 bits (test_candidates.py) may be candidates
    # of one of the hierarchies only.
    extent = np.ptp(np.concatenate([x_t0, x_t1]), axis=0).max(initial=0.0)
    k, moving = VOLUMES[ccd.volume]
    kinds = (np.arange(len(x_t0))[:, None], new.faces), (new.edges, new.edges)
    for (first, second), *found in zip(
        kinds, new.candidates(x_t0, x_t1), ccd.candidates(x_t0, x_t1), strict=True
    ):
        pairs = np.array(sorted(as_set(found[0]) ^ as_set(found[1])), dtype=int).reshape(-1, 2)
        rows = np.concatenate([first[pairs[:, 0]], second[pairs[:, 1]]], axis=1)
        gaps = [
            all_pairs.axis_distance(x_t0, x_t1, rows, first.shape[1], k, chosen)
            for chosen in ([moving] if moving is not None else [False, True])
        ]
        assert np.any([(gap > 0) & (gap < 1.5e-4 * extent) for gap in gaps], axis=0).all()


def tear(faces, x, vertex):
    """Split a vertex in two: half of its faces go to the copy."""
    around = np.flatnonzero((faces == vertex).any(axis=1))
    faces = faces.copy()
    chosen = faces[around[: len(around) // 2]]
    chosen[chosen == vertex] = len(x[0])
    faces[around[: len(around) // 2]] = chosen
    return faces, [np.vstack([p, p[vertex] + np.array([0, 0, 1e-3])]) for p in x]


def split_face(faces, x, face):
    """Three faces around a new vertex in place of one; the new rows come last."""
    a, b, c = faces[face]
    middle = len(x[0])
    new = [[a, b, middle], [b, c, middle], [c, a, middle]]
    x = [np.concatenate([p, p[faces[face]].mean(axis=0, keepdims=True)]) for p in x]
    return np.concatenate([np.delete(faces, face, axis=0), new]), x


def test_a_sheet_torn_to_pieces_step_by_step():
    rng = np.random.default_rng(0)
    faces, *x = sheet(14, rng)
    ccd = MeshCCD(faces)
    ccd.candidates(*x)
    for _ in range(40):
        kind = rng.integers(3)
        if kind == 0:
            faces = np.delete(faces, rng.integers(len(faces), size=5), axis=0)
        elif kind == 1:
            faces, x = tear(faces, x, int(faces[rng.integers(len(faces)), 0]))
        else:
            faces, x = split_face(faces, x, int(rng.integers(len(faces))))
        ccd.update_topology(faces)
        assert_like_new(ccd, faces, *x)


@settings(deadline=None, max_examples=60)
@given(st.data())
def test_any_faces_may_follow_any_faces(data):
    n = 9
    face = st.lists(st.integers(0, n - 1), min_size=3, max_size=3, unique=True)
    meshes = st.lists(face, max_size=60).map(lambda f: np.array(f, int).reshape(-1, 3))
    x = np.random.default_rng(0).random((2, n, 3))
    ccd = MeshCCD(data.draw(meshes))
    if data.draw(st.booleans()):
        ccd.candidates(*x)
    for _ in range(3):
        faces = data.draw(meshes)
        ccd.update_topology(faces)
        assert_like_new(ccd, faces, *x)


def test_more_new_faces_than_there_is_room_for():
    faces, *x = sheet(6, np.random.default_rng(1))
    ccd = MeshCCD(faces[:10])
    ccd.candidates(*x)
    change = ccd.update_topology(faces)
    assert change["faces"] == (0, len(faces) - 10)
    assert change["rebuilt"] > 0
    assert_like_new(ccd, faces, *x)


def test_a_small_cut_keeps_the_hierarchy_and_the_front():
    faces, *x = sheet(40, np.random.default_rng(2))
    ccd = MeshCCD(faces)
    ccd.candidates(*x)
    cut = np.delete(faces, np.arange(100, 110), axis=0)
    change = ccd.update_topology(cut)
    assert change["faces"] == (10, 0)
    assert change["rebuilt"] == 0
    before = ccd.broad_stats["ee"]["front"]
    ccd.candidates(*x)
    assert ccd.broad_stats["builds"] == 0
    assert abs(ccd.broad_stats["ee"]["front"] - before) < 0.05 * before


def test_only_the_first_new_features_rebuild_the_hierarchy():
    faces, *x = sheet(40, np.random.default_rng(6))
    ccd = MeshCCD(faces)
    ccd.candidates(*x)
    rebuilt = []
    for face in range(100, 1300, 60):
        faces, x = split_face(faces, x, face)
        rebuilt.append(ccd.update_topology(faces)["rebuilt"] > 0)
    assert_like_new(ccd, faces, *x)
    assert rebuilt == [True] + [False] * 19


def test_repeated_and_reordered_faces():
    faces, *x = sheet(5, np.random.default_rng(3))
    ccd = MeshCCD(faces)
    ccd.candidates(*x)
    for after in (
        np.concatenate([faces, faces]),
        faces[::-1],
        np.roll(faces, 1, axis=1),
        faces[:0],
    ):
        ccd.update_topology(after)
        assert_like_new(ccd, after, *x)


def test_groups_grow_with_the_mesh():
    faces, *x = sheet(8, np.random.default_rng(4))
    n = len(x[0])
    both = np.concatenate([faces, faces + n])
    x = [np.concatenate([p, p + 0.01]) for p in x]
    table = [[True, True], [True, False]]
    ccd = MeshCCD(both, groups=Groups(np.repeat([0, 1], n), table))
    ccd.candidates(*x)
    torn, x = tear(both, x, int(faces[40, 0]))
    groups = Groups(np.append(np.repeat([0, 1], n), 0), table)
    ccd.update_topology(torn, groups)
    assert_like_new(ccd, torn, *x, groups=groups)
    assert len(as_set(ccd.candidates(*x)[0])) > 0


def test_bad_new_faces_are_named_and_change_nothing():
    faces, *x = sheet(4, np.random.default_rng(5))
    ccd = MeshCCD(faces)
    with pytest.raises(ValueError, match=r"faces: row 0 is \[1, 1, 2\]"):
        ccd.update_topology([[1, 1, 2]])
    assert_like_new(ccd, faces, *x)
