"""The smallest parts of the study rigid, through the command line."""

import os
import subprocess
import sys

import numpy as np
import pytest

from oracles import coal_peer
from oracles.convex_pairs import pairs_by_outcome
from tauguard.rigid import Hulls


def no_errors(rows):
    """What is asked of errors is met; a time may be left to the full run."""
    asked = [row for row in rows if row["study"] == "summary"]
    assert asked
    assert all(row["met"] in (True, "full run") for row in asked), asked


def test_volumes_hold_their_bodies(bench, monkeypatch):
    monkeypatch.delenv("TAUGUARD_DATA", raising=False)
    monkeypatch.delenv("TAUGUARD_MESH", raising=False)
    rows = bench("rigid-volumes")[0]["rows"]
    volumes = {row["volume"]: row for row in rows if row["study"] == "figure 1.1 volumes"}
    assert set(volumes) == {"sphere", "aabb", "obb", "k_dop", "hull"}
    for name, row in volumes.items():
        assert row["missed"]["value"] == 0
        assert row["tightness"] > 1 or name == "hull"
    no_errors(rows)


def test_motion_stands_beside_advancement_over_coal(bench):
    rows = bench("rigid-motion")[0]["rows"]
    methods = [(row["bodies"], row["method"]) for row in rows if row["study"] == "time of impact"]
    assert len(methods) == len(set(methods)) == 4
    no_errors(rows)


def test_a_mesh_that_cannot_be_read_is_one_line(tmp_path):
    command = [sys.executable, "-m", "tauguard", "bench", "rigid-mesh", "--quick"]
    named = os.environ | {"TAUGUARD_MESH": str(tmp_path / "none.obj")}
    done = subprocess.run(command, cwd=tmp_path, env=named, capture_output=True, text=True)
    assert done.returncode == 2
    assert "TAUGUARD_MESH: none.obj" in done.stderr
    assert done.stderr.count("\n") == 1


def test_coal_agrees_away_from_contact():
    pytest.importorskip("coal")
    rng = np.random.default_rng(0)
    for outcome, a, b in pairs_by_outcome(rng, ("tetrahedra", "boxes"), 100, 10):
        hit = coal_peer.collide(a, b, len(a))
        assert (hit == (outcome == "collision")).mean() > 0.98


def test_coal_refuses_flat_hulls_by_their_row():
    # coal's convex hull of flat points ends the process.
    pytest.importorskip("coal")
    solid = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    flat = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.0]])
    with pytest.raises(ValueError, match="hull 1 is flat"):
        coal_peer.geometries(Hulls(np.concatenate([solid, flat]), [0, 4, 8]))
