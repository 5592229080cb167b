"""``safe_step`` of two bars of 384 to 98,304 faces: how its time grows with the faces."""

import time

import numpy as np
import pytest
import trimesh

from tauguard.cloth import MeshCCD

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("scale", [1.0, 1000.0])
def test_time_grows_with_the_faces(scale, slow_seed, counts):
    bar = trimesh.creation.box(extents=(1, 0.2, 0.2)).subdivide().subdivide()
    rng, faces, seconds = np.random.default_rng(slow_seed), [], []
    for _ in range(5):
        x = np.concatenate([bar.vertices, bar.vertices + np.array([0, 0, 0.5])])
        rows = np.concatenate([bar.faces, bar.faces + len(bar.vertices)])
        end = x + scale * rng.normal(size=x.shape)
        runs = []
        for _ in range(3):
            ccd, start = MeshCCD(rows), time.process_time()
            share = ccd.safe_step(x, end)
            runs.append(time.process_time() - start)
        assert ccd.find(x, x + share * (end - x)).first_time() == np.inf
        assert ccd.find(x, x + share / 0.9 * (1 + 1e-6) * (end - x)).first_time() <= 1
        faces.append(len(rows))
        seconds.append(min(runs))
        bar = bar.subdivide()
    exponent = np.polyfit(np.log(faces), np.log(seconds), 1)[0]
    counts(faces=faces, ms=[round(1e3 * s, 1) for s in seconds], exponent=f"{exponent:.2f}")
    assert exponent <= 1.1
