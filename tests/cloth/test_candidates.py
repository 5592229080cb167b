"""The broad phase against all pairs, its front against a fresh descent, its variants."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from oracles import all_pairs
from tauguard.cloth import VOLUMES, Groups, MeshCCD, _mesh, edge_edge, vertex_face

KINDS = sorted({kind for kind in VOLUMES.values() if kind[1] is not None})


def name_of(kind):
    return next(name for name, value in VOLUMES.items() if value == kind)


def as_set(pairs):
    return {tuple(p) for p in np.asarray(pairs).tolist()}


def sheet(n, rng, rough=0.02):
    """A sheet of 2 n^2 faces, folded over itself, and the same a step later."""
    u, v = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1), indexing="ij")
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = np.concatenate(
        [
            np.stack([corner, corner + 1, corner + n + 2], axis=1),
            np.stack([corner, corner + n + 2, corner + n + 1], axis=1),
        ]
    )
    x = np.stack([np.abs(u - 0.5), v, 0.1 * np.sign(u - 0.5) + 0 * v], axis=-1).reshape(-1, 3)
    x_t0 = x + rough * rng.standard_normal(x.shape)
    x_t1 = x_t0 * [1, 1, -0.5] + [0.3, 0, 0] + rough * rng.standard_normal(x.shape)
    return faces, x_t0, x_t1


def check_against_all_pairs(ccd, x_t0, x_t1, kind, min_distance=0.0):
    x_t0, x_t1 = np.asarray(x_t0, float), np.asarray(x_t1, float)
    both = np.concatenate([x_t0, x_t1])
    size = np.abs(both).max(initial=0.0)
    extent = np.ptp(both, axis=0).max(initial=0.0)
    vf, vf_rows, ee, ee_rows = all_pairs.queries(ccd.faces)
    found_vf, found_ee = ccd.candidates(x_t0, x_t1, min_distance)
    for found, pairs, rows, split in ((found_vf, vf, vf_rows, 1), (found_ee, ee, ee_rows, 2)):
        gaps = all_pairs.axis_distance(x_t0, x_t1, rows, split, *kind) if len(rows) else np.zeros(0)
        must = pairs[gaps <= min_distance - 1e-14 * size]
        # The extent has at least 32,000 steps of 16 bits on a coordinate axis, and its values of
        # less than a step are one. A step on a corner axis is 4 / sqrt(3) times as long.
        may = pairs[gaps <= min_distance * (1 + 1e-5) + 1e-14 * size + 1.5e-4 * extent]
        assert as_set(must) <= as_set(found) <= as_set(may)
        assert len(as_set(found)) == len(found)
        assert found.tolist() == sorted(found.tolist())


@pytest.mark.parametrize("kind", KINDS, ids=name_of)
@pytest.mark.parametrize("min_distance", [0.0, 0.05])
def test_folded_sheet_equals_all_pairs(kind, min_distance):
    faces, x_t0, x_t1 = sheet(7, np.random.default_rng(0))
    ccd = MeshCCD(faces, volume=name_of(kind))
    assert np.array_equal(ccd.edges, all_pairs.edges_of(faces))
    check_against_all_pairs(ccd, x_t0, x_t1, kind, min_distance)


@st.composite
def small_meshes(draw):
    """Any faces over up to 12 vertices: shared, repeated, non-manifold; on a small lattice."""
    n = draw(st.integers(3, 12))
    faces = draw(
        st.lists(st.lists(st.integers(0, n - 1), min_size=3, max_size=3, unique=True), max_size=14)
    )
    shape = st.just((2, n, 3))
    lattice = hnp.arrays(np.float64, shape, elements=st.integers(-2, 2))
    reals = hnp.arrays(np.float64, shape, elements=st.floats(-1, 1))
    x = draw(st.one_of(lattice, reals))
    scale = 2.0 ** draw(st.sampled_from([-300, -20, 0, 20, 300]))
    return np.array(faces, dtype=int).reshape(-1, 3), x[0] * scale, x[1] * scale


@settings(deadline=None, max_examples=150)
@given(small_meshes(), st.sampled_from(KINDS))
def test_any_small_mesh_equals_all_pairs(mesh, kind):
    faces, x_t0, x_t1 = mesh
    check_against_all_pairs(MeshCCD(faces, volume=name_of(kind)), x_t0, x_t1, kind)


@pytest.mark.parametrize("offset", [1e6, 1e10, -1e10])
def test_far_from_the_origin(offset):
    faces, x_t0, x_t1 = sheet(6, np.random.default_rng(1))
    kind = (18, True)
    check_against_all_pairs(
        MeshCCD(faces, volume=name_of(kind)), x_t0 + offset, x_t1 + offset, kind
    )


@pytest.mark.parametrize("exponent", [-1070, -1000, 1022])
def test_smallest_and_largest_positions_lose_nothing(exponent):
    faces, *x = sheet(5, np.random.default_rng(2))
    scaled = [np.ldexp(p, exponent) for p in x]  # subnormal: what survives of them is the truth
    mesh = MeshCCD(faces, volume="moving_k_dop14")
    reference = mesh.candidates(*(np.ldexp(p, -exponent) for p in scaled))
    found = mesh.candidates(*scaled)
    for want, have in zip(reference, found, strict=True):
        assert as_set(want) <= as_set(have)


def test_the_automatic_volume_moves_in_fast_steps_alone():
    faces, x, _ = sheet(24, np.random.default_rng(4))
    meshes = {name: MeshCCD(faces, volume=name) for name in ("auto", "k_dop14", "moving_k_dop14")}
    edge = np.abs(x[meshes["auto"].edges[:, 0]] - x[meshes["auto"].edges[:, 1]]).max(axis=1).mean()
    for fraction, kind in ((0.05, "k_dop14"), (3.0, "moving_k_dop14"), (0.1, "k_dop14")):
        end = x + fraction * edge * np.cos(9 * x[:, ::-1])
        found = {name: ccd.candidates(x, end) for name, ccd in meshes.items()}
        assert len(found["moving_k_dop14"][1]) < len(found["k_dop14"][1])
        for want, have in zip(found[kind], found["auto"], strict=True):
            assert np.array_equal(want, have)


@pytest.mark.parametrize("volume", ["aabb", "moving_k_dop18", "auto"])
def test_front_equals_fresh_descent_over_a_motion(volume):
    rng = np.random.default_rng(3)
    faces, x, _ = sheet(24, rng)
    kept = MeshCCD(faces, volume=volume)
    tests_kept = tests_fresh = 0
    for step in range(12):
        drift = 0.02 * np.sin(9 * x[:, ::-1] + step) + [0, 0, -0.02 * np.cos(step / 2)]
        fresh = MeshCCD(faces, volume=volume)
        for want, have in zip(
            fresh.candidates(x, x + drift), kept.candidates(x, x + drift), strict=True
        ):
            assert np.array_equal(want, have)
        tests_kept += kept.broad_stats["ee"]["node_tests"]
        tests_fresh += fresh.broad_stats["ee"]["node_tests"]
        x = x + drift
    assert 0 < tests_kept < 1.2 * tests_fresh


def test_front_shrinks_again_after_a_collision_is_over():
    faces, x, _ = sheet(24, np.random.default_rng(4))
    crumpled = x * 0.05
    ccd = MeshCCD(faces)
    ccd.candidates(x, x)
    before = ccd.broad_stats["ee"]["front"]
    ccd.candidates(crumpled @ np.diag([1, 1, 0]), crumpled @ np.diag([0, 1, 1]))
    during = ccd.broad_stats["ee"]["front"]
    for _ in range(10):
        ccd.candidates(x, x)
    after = ccd.broad_stats["ee"]["front"]
    assert before < during
    assert after - before < 0.1 * (during - before)


@pytest.mark.parametrize("volume", ["moving_k_dop14", "auto"])
def test_a_far_and_large_triangle_hardly_adds_candidates(volume):
    faces, x_t0, x_t1 = sheet(24, np.random.default_rng(9))
    near = MeshCCD(faces, volume=volume).candidates(x_t0, x_t1)
    far = np.array([[4e3, 0, 0], [4e3, 4e3, 0], [4e3, 0, 4e3]])  # a step of 16 bits is an edge
    n = len(x_t0)
    faces = np.concatenate([faces, [[n, n + 1, n + 2]]])
    both = MeshCCD(faces, volume=volume)
    found = both.candidates(np.concatenate([x_t0, far]), np.concatenate([x_t1, far]))
    for alone, together in zip(near, found, strict=True):
        assert 0 < len(together) < 1.2 * len(alone)


def test_any_thread_count_gives_the_same_candidates():
    faces, x_t0, x_t1 = sheet(30, np.random.default_rng(5))
    one = MeshCCD(faces, threads=1).candidates(x_t0, x_t1)
    for threads in (2, 3, 7):
        many = MeshCCD(faces, threads=threads).candidates(x_t0, x_t1)
        assert all(np.array_equal(a, b) for a, b in zip(one, many, strict=True))


def leaf(rng, at, arity):
    """16 features of the vertices (vertex, axis, end): [axis][end][low, high][lane] and indices."""
    vertices = rng.integers(0, len(at), (arity, 16), dtype=np.int32)
    volumes = np.stack([at[vertices].min(axis=0), at[vertices].max(axis=0)])
    volumes[0, 3], volumes[1, 3], vertices[:, 3] = np.inf, -np.inf, -1  # an empty lane
    return np.ascontiguousarray(volumes.transpose(2, 3, 0, 1), dtype=np.float32), vertices


def pairs_by_definition(a, b, same):
    (volumes_a, vertices_a), (volumes_b, vertices_b) = a, b
    meets, adjacent = np.zeros((16, 16), dtype=bool), 0
    for i, j in itertools.product(range(16), range(16)):
        (low, high), (low_b, high_b) = volumes_a[..., i].T, volumes_b[..., j].T
        apart = (high < low_b).all(axis=0).any() or (high_b < low).all(axis=0).any()
        if not apart and not (same and j <= i):
            shared = bool(set(vertices_a[:, i]) & set(vertices_b[:, j]))
            meets[i, j] = not shared
            adjacent += shared
    return [*(meets @ (1 << np.arange(16))), adjacent]


@pytest.mark.parametrize("times", [1, 2])
@pytest.mark.parametrize("axes", [3, 7, 13])
@pytest.mark.parametrize(
    ("arity_a", "arity_b", "same"), [(1, 3, False), (2, 2, False), (2, 2, True)]
)
def test_every_variant_finds_the_pairs_of_two_leaves(axes, times, arity_a, arity_b, same):
    rng = np.random.default_rng(6)
    found = 0
    for _ in range(10):
        at = rng.integers(-1, 2, (60, axes, times)).astype(np.float32)
        a = leaf(rng, at, arity_a)
        b = a if same else leaf(rng, at, arity_b)
        want = pairs_by_definition(a, b, same)
        found += want[-1]
        for variant, bound in itertools.product(("portable", "avx2"), (np.float32, np.int16)):
            left, right = (np.clip(x[0], -9, 9).astype(bound) for x in (a, b))
            have = _mesh.leaf_pair(variant, left, right, a[1], b[1], bool(same))
            assert len(have) or variant != "portable"
            assert not len(have) or have.tolist() == want, variant
    assert found > 0


class TestGroups:
    def test_pairs_of_groups_that_do_not_meet_are_left_out(self):
        faces, x_t0, x_t1 = sheet(10, np.random.default_rng(7))
        n = len(x_t0)
        faces = np.concatenate([faces, faces + n, faces + 2 * n])
        x_t0, x_t1 = (np.concatenate([x, x + 0.03, x - 0.02]) for x in (x_t0, x_t1))
        ids = np.repeat([0, 1, 2], n)
        meets = np.array([[1, 1, 0], [1, 0, 1], [0, 1, 1]], dtype=bool)
        everything = MeshCCD(faces)
        vf, ee = everything.candidates(x_t0, x_t1)
        vf = vf[meets[ids[vf[:, 0]], ids[faces[vf[:, 1], 0]]]]
        edge_group = ids[everything.edges[:, 0]]
        ee = ee[meets[edge_group[ee[:, 0]], edge_group[ee[:, 1]]]]
        ccd = MeshCCD(faces, groups=Groups(ids, meets))
        found_vf, found_ee = ccd.candidates(x_t0, x_t1)
        assert np.array_equal(vf, found_vf)
        assert np.array_equal(ee, found_ee)
        assert 0 < len(found_ee) < len(everything.candidates(x_t0, x_t1)[1])

    def test_more_groups_than_bits_of_a_word(self):
        rng = np.random.default_rng(8)
        count = 150
        faces = np.arange(3 * count).reshape(-1, 3)
        x = rng.random((3 * count, 3)) * 0.3
        ids = np.repeat(np.arange(count), 3)
        table = rng.random((count, count)) < 0.3
        table |= table.T
        vf, _ = MeshCCD(faces, groups=Groups(ids, table)).candidates(x, x)
        everything, _ = MeshCCD(faces).candidates(x, x)
        want = everything[table[ids[everything[:, 0]], everything[:, 1]]]
        assert np.array_equal(vf, want)
        assert 0 < len(vf) < len(everything)

    def test_a_body_that_meets_nothing_costs_nothing(self):
        faces, x_t0, x_t1 = sheet(20, np.random.default_rng(9))
        ccd = MeshCCD(faces, groups=Groups(np.zeros(len(x_t0), int), [[False]]))
        vf, ee = ccd.candidates(x_t0, x_t1)
        assert len(vf) == len(ee) == ccd.broad_stats["ee"]["leaf_pairs"] == 0

    @pytest.mark.parametrize(
        ("ids", "meets", "message"),
        [
            ([0, 2], [[1, 1], [1, 1]], r"ids: index 2 in row 1, expected 0 to 1"),
            ([0, 1], [[1, 1], [0, 1]], r"meets: \[0, 1\] is True but \[1, 0\] is False"),
            ([0, 1], [[1, 1]], r"meets: shape \(1, 2\), expected \(G, G\)"),
            ([0, 1], [[1, 1], [1]], r"meets: rows of different lengths"),
            ([0, 1], [["True", ""], ["", "True"]], r"meets: dtype <U4, expected bools"),
            ([0], [[1j]], r"meets: dtype complex128, expected bools"),
            ([0, 1], [[1, 2], [2, 1]], r"meets: dtype int64, expected bools, or only 0 and 1"),
            ([0], [[np.nan]], r"meets: dtype float64"),
        ],
    )
    def test_bad_tables_are_named(self, ids, meets, message):
        with pytest.raises(ValueError, match=message):
            Groups(ids, meets)

    def test_ids_alone_are_no_groups(self):
        with pytest.raises(ValueError, match=r"groups: list, expected Groups\(ids, meets\)"):
            MeshCCD([[0, 1, 2]], groups=[0, 0, 0])
        ccd = MeshCCD([[0, 1, 2]])
        with pytest.raises(ValueError, match=r"groups: ndarray, expected Groups"):
            ccd.update_topology([[0, 1, 2]], np.zeros(3, int))

    def test_two_of_them_can_be_compared(self):
        a, b = (Groups([0, 0, 1], np.eye(2)) for _ in range(2))
        assert a == a
        assert a != b
        assert len({a, b}) == 2

    def test_a_face_of_two_groups_is_named(self):
        with pytest.raises(ValueError, match=r"faces: row 1 has vertices of groups \[1, 1, 0\]"):
            MeshCCD([[0, 1, 2], [3, 4, 0]], groups=Groups([0, 0, 0, 1, 1], np.eye(2)))


class TestBadInput:
    faces = ((0, 1, 2), (1, 2, 3))
    x = np.arange(12.0).reshape(4, 3)

    @pytest.mark.parametrize(
        ("faces", "message"),
        [
            ([[0, 1, 2], [3, 4, 3]], r"faces: row 1 is \[3, 4, 3\]: it repeats a vertex"),
            ([[0, 1, -1]], r"faces: index -1 in row 0"),
            ([[0.5, 1, 2]], r"faces: dtype float64"),
            ([[0, 1]], r"faces: shape \(1, 2\)"),
        ],
    )
    def test_faces(self, faces, message):
        with pytest.raises(ValueError, match=message):
            MeshCCD(faces)

    @pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
    def test_positions_that_are_not_finite(self, bad):
        x = self.x.copy()
        x[2, 1] = bad
        with pytest.raises(ValueError, match=r"x_t1: .* in row 2"):
            MeshCCD(self.faces).candidates(self.x, x)

    def test_ends_of_different_size(self):
        with pytest.raises(ValueError, match="x_t1: 3 vertices, but x_t0 has 4"):
            MeshCCD(self.faces).candidates(self.x, self.x[:3])

    def test_too_few_vertices_for_the_faces(self):
        with pytest.raises(
            ValueError, match=r"faces: row 1 is \[1, 2, 3\], but x_t0 has 3 vertices"
        ):
            MeshCCD(self.faces).candidates(self.x[:3], self.x[:3])

    def test_frames_of_different_size(self):
        ccd = MeshCCD(self.faces)
        ccd.candidates(self.x, self.x)
        longer = np.concatenate([self.x, self.x])
        with pytest.raises(ValueError, match="8 vertices, but the frames before had 4"):
            ccd.candidates(longer, longer)

    @pytest.mark.parametrize(
        "distance",
        [
            *(-1.0, np.nan, np.inf, "a", "0.1", None, [0.1], 1j, True, 10**400, {}, b"1"),
            *(np.array("0.1"), np.array(True), np.complex128(1 + 2j), [[0.1], []]),
        ],
    )
    def test_distance(self, distance):
        x = np.zeros((1, 4, 3))
        for call in (
            lambda: MeshCCD(self.faces).candidates(self.x, self.x, distance),
            lambda: MeshCCD(self.faces).find(self.x, self.x, distance),
            lambda: vertex_face(x, x, min_distance=distance),
            lambda: edge_edge(x, x, min_distance=distance),
        ):
            with pytest.raises(
                ValueError, match=r"min_distance: .*, expected a finite number >= 0"
            ):
                call()

    @pytest.mark.parametrize("distance", [0, np.float32(0.5), np.array(0.5), np.int64(1), 10**20])
    def test_any_number_is_a_distance(self, distance):
        mesh = MeshCCD(self.faces)
        of_float = mesh.candidates(self.x, self.x, float(distance))
        assert all(map(np.array_equal, mesh.candidates(self.x, self.x, distance), of_float))

    @pytest.mark.parametrize("fresh", ["yes", None, 1, [True]])
    def test_fresh(self, fresh):
        for call in (MeshCCD(self.faces).find, MeshCCD(self.faces).candidates):
            with pytest.raises(ValueError, match=r"fresh: .*, expected True or False"):
                call(self.x, self.x, fresh=fresh)

    @pytest.mark.parametrize("name", [["ab2pf"], {}, None, 0])
    def test_names_that_are_no_text(self, name):
        with pytest.raises(ValueError, match=r"method .*: expected one of ab2pf, "):
            MeshCCD(self.faces, method=name)
        with pytest.raises(ValueError, match=r"volume .*: expected one of auto, k_dop6, "):
            MeshCCD(self.faces, volume=name)

    def test_numbers_beyond_the_doubles(self):
        with pytest.raises(ValueError, match="x_t0: not an array of numbers"):
            MeshCCD(self.faces).find([[10**400, 0, 0]], self.x)

    @pytest.mark.parametrize("threads", [-1, 1.5, "2", None, True, 2**31])
    def test_threads(self, threads):
        with pytest.raises(ValueError, match=r"threads: .*, expected an integer from 0 \(all"):
            MeshCCD(self.faces, threads=threads)
        assert MeshCCD(self.faces, threads=np.int64(2)).threads == 2

    def test_volume(self):
        with pytest.raises(ValueError, match="volume 'sphere': expected one of auto, k_dop6, "):
            MeshCCD(self.faces, volume="sphere")


def test_empty_meshes():
    for faces, x in (
        ([], np.zeros((0, 3))),
        ([], np.zeros((5, 3))),
        ([[0, 1, 2]], np.ones((3, 3))),
    ):
        vf, ee = MeshCCD(faces).candidates(x, x)
        assert vf.shape == ee.shape == (0, 2)
        assert vf.dtype == ee.dtype == np.int32
