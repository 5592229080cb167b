"""Real frames with exact truth: every listed collision is a candidate, with any volume."""

import numpy as np
import pytest

from oracles.recorded_collisions import keys, load_frame
from tauguard.cloth import MeshCCD


@pytest.fixture(scope="module", params=["cloth-funnel", "cloth-ball"])
def scene(data_dir, request):
    """Reading a frame takes longer than its candidates."""
    return load_frame(data_dir, request.param)


@pytest.mark.data
@pytest.mark.parametrize("volume", ["auto", "aabb", "k_dop18", "moving_k_dop14", "moving_k_dop26"])
def test_no_collision_is_lost(scene, volume):
    ccd = MeshCCD(scene.faces, volume=volume)
    assert np.array_equal(ccd.edges, scene.edges)
    for found, hits in zip(ccd.candidates(scene.x_t0, scene.x_t1), scene.hits, strict=True):
        assert len(hits) > 20
        place = np.searchsorted(keys(found), keys(hits))
        assert np.array_equal(found[np.minimum(place, len(found) - 1)], hits)
