"""Swept boxes against ipctk's broad phases on the same meshes."""

import numpy as np
import pytest

from tauguard.cloth import MeshCCD
from tests.cloth.test_candidates import as_set, sheet

ipctk = pytest.importorskip("ipctk")


def peer_candidates(method, edges, faces, x_t0, x_t1):
    x_t0, x_t1 = np.asfortranarray(x_t0), np.asfortranarray(x_t1)
    mesh = ipctk.CollisionMesh(x_t0, edges.astype(np.int32), faces.astype(np.int32))
    found = ipctk.Candidates()
    found.build(mesh, x_t0, x_t1, 0.0, method())
    vf = {(c.vertex_id, c.face_id) for c in found.fv_candidates}
    ee = {tuple(sorted((c.edge0_id, c.edge1_id))) for c in found.ee_candidates}
    return vf, ee


@pytest.mark.parametrize("method", [ipctk.BruteForce, ipctk.LBVH, ipctk.SweepAndPrune])
@pytest.mark.parametrize("seed", [0, 1])
def test_same_pairs_as_the_peer(method, seed):
    faces, x_t0, x_t1 = sheet(12, np.random.default_rng(seed), rough=0.04)
    ccd = MeshCCD(faces, volume="aabb")
    vf, ee = (as_set(pairs) for pairs in ccd.candidates(x_t0, x_t1))
    peer_vf, peer_ee = peer_candidates(method, ccd.edges, faces, x_t0, x_t1)
    assert len(ee) > 1000
    assert vf == peer_vf
    assert ee == peer_ee
