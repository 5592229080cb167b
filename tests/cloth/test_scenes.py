"""Generated motions: sizes, determinism, coherence."""

import numpy as np
import pytest

from tauguard.cloth import MeshCCD
from tauguard.cloth.comparators import ComparedMeshCCD
from tauguard.cloth.scenes import SCENES


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
