"""Generated and recorded motions: sizes, determinism, coherence, file formats and their order."""

import numpy as np
import pytest

from tauguard.cloth import MeshCCD
from tauguard.cloth.comparators import ComparedMeshCCD
from tauguard.cloth.scenes import SCENES, load_sequence


@pytest.mark.parametrize("name", SCENES)
class TestGenerated:
    @pytest.mark.parametrize("triangles", [1_000, 30_000])
    def test_size_and_indices(self, name, triangles):
        scene = SCENES[name](triangles, 0)
        x = scene.positions(0.5)
        assert 0.85 < len(scene.faces) / triangles < 1.15
        assert np.array_equal(np.unique(scene.faces), np.arange(len(x)))
        assert np.isfinite(x).all()
        MeshCCD(scene.faces, groups=scene.groups)  # no repeated vertex, one group a face

    def test_closed_under_edges(self, name):
        """Every edge has one face or two: the meshes are surfaces."""
        faces = SCENES[name](1_500, 0).faces
        edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        _, count = np.unique(edges, axis=0, return_counts=True)
        assert set(count.tolist()) <= {1, 2}

    def test_same_arguments_same_bytes(self, name):
        a, b, c = (SCENES[name](1_000, seed) for seed in (5, 5, 6))
        assert a.positions(0.7).tobytes() == b.positions(0.7).tobytes()
        assert a.faces.tobytes() == b.faces.tobytes()
        assert a.positions(0.7).tobytes() != c.positions(0.7).tobytes()

    def test_steps_are_coherent(self, name):
        """A step moves a vertex by about an edge at most: what a traversal front lives on."""
        scene = SCENES[name](4_000, 0)
        edges = MeshCCD(scene.faces).edges
        for x_t0, x_t1 in scene.steps():
            edge = np.median(np.linalg.norm(x_t0[edges[:, 0]] - x_t0[edges[:, 1]], axis=1))
            assert np.median(np.linalg.norm(x_t1 - x_t0, axis=1)) < 1.6 * edge

    def test_it_folds(self, name):
        """The last step brings together features that are far apart on the surface."""
        scene = SCENES[name](4_000, 0)
        steps = list(scene.steps(20))
        ccd = MeshCCD(scene.faces, groups=scene.groups)
        first = sum(map(len, ccd.candidates(*steps[0])))
        last = sum(map(len, ccd.candidates(*steps[-1])))
        assert last > 2_000
        assert last > 2 * first


def write_ply(path, x, faces, big_endian):
    order = ">" if big_endian else "<"
    head = (
        f"ply\nformat binary_{'big' if big_endian else 'little'}_endian 1.0\n"
        f"element vertex {len(x)}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = np.empty(len(faces), dtype=[("n", "u1"), ("v", order + "i4", 3)])
    rows["n"], rows["v"] = 3, faces
    path.write_bytes(head.encode() + x.astype(order + "f4").tobytes() + rows.tobytes())


def write_obj(path, x, faces):
    lines = [f"v {a!r} {b!r} {c!r}" for a, b, c in x.tolist()]
    lines += ["f " + " ".join(f"{v + 1}//1" for v in face) for face in faces.tolist()]
    path.write_text("vn 0 0 1\n" + "\n".join(lines) + "\n")


class TestRecorded:
    faces = np.array([[0, 1, 2], [2, 1, 3]])

    def frame(self, i):
        # Vertices 0 and 4 coincide and 4 has no face: neither may be merged or dropped.
        x = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 0]]) + 0.125 * i
        return x.astype(float)

    @pytest.mark.parametrize("kind", ["big", "little", "obj"])
    def test_frames_in_order_of_their_number(self, tmp_path, kind):
        for i in (9, 10, 11, 100):
            path = tmp_path / f"cloth_{i}.{'obj' if kind == 'obj' else 'ply'}"
            if kind == "obj":
                write_obj(path, self.frame(i), self.faces)
            else:
                write_ply(path, self.frame(i), self.faces, kind == "big")
        sequence = load_sequence(tmp_path)
        assert len(sequence) == 4
        assert np.array_equal(sequence.faces, self.faces)
        for frame, i in enumerate((9, 10, 11, 100)):
            assert np.array_equal(sequence.positions(frame), self.frame(i))
        for (start, end), (i, j) in zip(
            sequence.steps(), ((9, 10), (10, 11), (11, 100)), strict=True
        ):
            assert np.array_equal(start, self.frame(i))
            assert np.array_equal(end, self.frame(j))

    def test_faces_that_change_are_named(self, tmp_path):
        write_obj(tmp_path / "a1.obj", self.frame(1), self.faces)
        write_obj(tmp_path / "a2.obj", self.frame(2), self.faces[::-1])
        with pytest.raises(ValueError, match=r"a2\.obj: its faces differ from .*a1\.obj"):
            list(load_sequence(tmp_path).steps())

    def test_frames_that_differ_in_size_are_named(self, tmp_path):
        write_obj(tmp_path / "a1.obj", self.frame(1), self.faces)
        write_obj(tmp_path / "a2.obj", self.frame(2)[:4], self.faces)
        with pytest.raises(ValueError, match=r"a2\.obj: 4 vertices, .*a1\.obj has 5"):
            list(load_sequence(tmp_path).steps())

    def test_nothing_to_read(self, tmp_path):
        with pytest.raises(ValueError, match=r"no \.ply or \.obj file matches 'x\*'"):
            load_sequence(tmp_path, "x*")
        (tmp_path / "x1.ply").write_bytes(b"ply\nnonsense")
        with pytest.raises(ValueError, match=r"x1\.ply: "):
            load_sequence(tmp_path, "x*")


@pytest.mark.data
@pytest.mark.parametrize(
    ("name", "pattern"), [("cloth-ball", "cloth_ball*"), ("cloth-funnel", "*")]
)
def test_real_recordings(data_dir, name, pattern):
    sequence = load_sequence(data_dir / "ccd" / name / "frames", pattern)
    sizes = {"cloth-ball": (46_598, 92_230), "cloth-funnel": (9_450, 18_484)}
    ((x_t0, x_t1),) = sequence.steps()
    assert (len(x_t0), len(sequence.faces)) == sizes[name]
    assert len(x_t1) == len(x_t0)


def test_faces_that_slide_on_each_other_are_all_found():
    """Every contact lies in one plane throughout: a cubic that is zero, which comparators skip."""
    scene = SCENES["packed_cubes"](400, 1)
    step = scene.positions(0.8), scene.positions(0.85)
    found = {
        method: ComparedMeshCCD(scene.faces, method, groups=scene.groups).find(*step)
        for method in ("ab2pf", "exact", "iccd")
    }
    assert found["ab2pf"].vf.tobytes() == found["exact"].vf.tobytes()
    assert found["ab2pf"].ee.tobytes() == found["exact"].ee.tobytes()
    assert (found["ab2pf"].vf_impacts.toi == 0).all()
    assert len(found["iccd"].ee) < len(found["ab2pf"].ee)


def test_faces_that_slide_into_contact_are_decided_in_their_plane():
    scene = SCENES["packed_cubes"](3_000, 1)
    step = scene.positions(0.7), scene.positions(0.9)
    ours, exact = (
        MeshCCD(scene.faces, method, groups=scene.groups).find(*step)
        for method in ("ab2pf", "exact")
    )
    assert ours.stats.vf["sliding"] + ours.stats.ee["sliding"] > 100
    for a, b in ((ours.vf_impacts, exact.vf_impacts), (ours.ee_impacts, exact.ee_impacts)):
        assert ((a.toi > 0) == (b.toi > 0)).all()
        assert (a.toi <= b.toi).all()
        assert (a.toi >= b.toi - 1e-9).all()
    assert ours.vf.tobytes() == exact.vf.tobytes()
    assert ours.ee.tobytes() == exact.ee.tobytes()
