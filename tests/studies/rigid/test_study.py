"""The study rigid: what its rows hold and that a wrong answer would show."""

import json

import numpy as np
import pytest

from oracles.convex_impact import bracket
from studies.rigid import claims as rigid_claims
from studies.rigid import coal_motion
from studies.rigid import convex as rigid_convex
from studies.rigid import gap as rigid_gap
from studies.rigid import impact as rigid_impact
from studies.rigid import mesh as rigid_mesh
from studies.rigid import mesh_bodies as rigid_mesh_bodies
from studies.rigid import rounded as rigid_rounded
from studies.rigid import volumes as rigid_volumes
from tauguard.report import rate
from tauguard.rigid import Boxes, MeshTree, Motion, overlap


def test_a_static_cell_counts_wrong_answers():
    rng = np.random.default_rng(0)
    cells = rigid_convex.static_cells(rng, ("tetrahedra", "tetrahedra"), 200, 20)
    assert [outcome for outcome, _, _ in cells] == ["collision", "non-collision"]
    _, a, b = cells[0]
    row = rigid_convex.static_row(("tetrahedra", "tetrahedra"), "collision", a, b, 50)
    assert row["pairs"] == 200
    for name in rigid_convex.METHODS:
        assert row[f"{name}_wrong"]["value"] == 0
        assert row[f"{name}_ns"]["median"] > 0
    swapped = rigid_convex.static_row(("tetrahedra", "tetrahedra"), "non-collision", a, b, 50)
    assert swapped["abfme_wrong"]["value"] == 1
    assert swapped["published"] == 1.12


def test_dynamic_rows_name_the_un_inverted_entries():
    pair = ("parallelepipeds", "tetrahedra")
    collision, clear = rigid_convex.dynamic_rows(np.random.default_rng(1), pair, 100, 20)
    assert collision["pairs"] + clear["pairs"] == 200
    assert "2.58 and 1.37" in collision["note"]
    assert collision["late_of_sample"]["value"] == 0
    assert collision["toi_error_max"] < 1e-9


def test_cached_planes_give_fresh_answers():
    for row in rigid_convex.coherent_rows(np.random.default_rng(3), 300, 3):
        assert row["differs_from_fresh"]["value"] == 0
        assert row["answered_by_cache"]["value"] > 0.8


def test_coal_agrees_away_from_contact():
    pytest.importorskip("coal")
    rng = np.random.default_rng(2)
    for pair in rigid_convex.PAIRS:
        for outcome, a, b in rigid_convex.static_cells(rng, pair, 100, 10):
            assert (overlap(a, b, "gjk").hit == (outcome == "collision")).mean() > 0.98


def test_the_bracket_of_a_falling_cube_holds_the_time_that_geometry_says():
    cube = Boxes(np.zeros((2, 3)), np.full((2, 3), 0.5), np.tile(np.eye(3), (2, 1, 1)))
    pose = np.tile(np.eye(4), (2, 1, 1))
    pose[:, 2, 3] = 2.0
    rest = Motion(np.tile(np.eye(4), (2, 1, 1)), np.zeros((2, 3)), np.zeros((2, 3)))
    fall = Motion(pose, [[0, 0, -4.0], [0, 0, 4.0]], np.zeros((2, 3)))
    early, touch = bracket(cube, cube, rest, fall)
    assert early[0] <= 0.25 <= touch[0]
    assert touch[0] - early[0] < 1e-10
    assert np.isinf(early[1])
    assert np.isinf(touch[1])


def test_a_wrong_time_of_impact_would_show():
    early, touch = np.array([0.3, 0.5, np.inf, np.inf]), np.array([0.3, 0.5, np.inf, np.inf])
    row = rigid_impact.judged(early, touch, np.array([0.3 + 1e-6, np.inf, np.inf, 0.2]))
    assert [row[name]["value"] for name in ("missed", "false", "late")] == [0.5, 0.5, 0.5]
    assert row["toi_error_max"] == pytest.approx(1e-6)


@pytest.mark.parametrize("kind", ["boxes", "tetrahedra"])
def test_moving_bodies_are_never_late_never_missed_and_close(kind):
    a, b, ma, mb = rigid_impact.pairs(np.random.default_rng(4), kind, 300)
    row = rigid_impact.our_row(kind, a, b, ma, mb, *bracket(a, b, ma, mb))
    assert row["hits"] > 10
    assert [row[name]["value"] for name in ("missed", "false", "late")] == [0, 0, 0]
    assert row["toi_error_max"] <= 1e-7


def test_mesh_rows_on_a_generated_mesh(monkeypatch):
    pytest.importorskip("coal")
    monkeypatch.delenv("TAUGUARD_DATA", raising=False)
    monkeypatch.delenv("TAUGUARD_MESH", raising=False)
    mesh = rigid_mesh.load(quick=True)
    assert (mesh.name, len(mesh.faces)) == ("generated", 7080)
    poses = rigid_mesh.poses_near(mesh, np.random.default_rng(0), 60)
    peer = rigid_mesh.Peer(mesh, poses)
    static = rigid_mesh.static_rows(mesh, poses, peer, 1)
    assert len(static) == 8
    assert all(row["disagree"]["value"] == 0 for row in static)
    for row in rigid_mesh.dynamic_rows(mesh, poses, peer, np.random.default_rng(1), 6):
        assert row["late_or_missed"]["value"] == 0
        assert row["not_touching_1e-7_later"]["value"] in (0, None)


def test_a_mesh_file_can_be_named(monkeypatch, tmp_path):
    path = tmp_path / "one.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    monkeypatch.setenv("TAUGUARD_MESH", str(path))
    mesh = rigid_mesh.load(quick=True)
    assert (mesh.name, len(mesh.faces), mesh.size) == ("one", 1, np.sqrt(2))
    monkeypatch.setenv("TAUGUARD_MESH", str(tmp_path / "none.obj"))
    with pytest.raises(ValueError, match=r"TAUGUARD_MESH: none\.obj"):
        rigid_mesh.load(quick=True)


def test_volumes_hold_their_bodies_and_miss_no_pair_of_hulls(monkeypatch):
    monkeypatch.delenv("TAUGUARD_DATA", raising=False)
    monkeypatch.delenv("TAUGUARD_MESH", raising=False)
    rng = np.random.default_rng(0)
    bodies = rigid_volumes.pieces(rigid_mesh.load(quick=True), 64)
    assert len(bodies.corners) == 7080
    poses = rigid_volumes.near(bodies, rng)
    pairs = rng.integers(0, len(bodies), (400, 2))
    hulls = rigid_volumes.Hull(bodies)
    hit = hulls.meet(poses, pairs)
    assert 20 < hit.sum() < 380
    for name, kind in rigid_volumes.NATIVE.items():
        volume = kind(bodies.corners, bodies.offsets)
        row = rigid_volumes.volume_row(name, volume, bodies, hulls, poses, pairs, hit, 1)
        assert row["missed"]["value"] == 0
        assert row["tightness"] > 1
        assert 0 < row["false_hits"]["value"] < 0.9


def test_the_size_of_a_volume_is_that_of_geometry():
    cube = np.array(
        [[[x, y, z] for z in (-1.0, 1.0)] + [[x, y, 0.0]] for x in (-1, 1) for y in (-1, 1)]
    )
    expected = {"sphere": 4 / 3 * np.pi * 3**1.5, "aabb": 8.0, "k_dop": 8.0}
    for name, value in expected.items():
        volume = rigid_volumes.NATIVE[name](cube, np.array([0, 4]))
        numbers = np.empty((1, volume.numbers))
        volume.write(numbers)
        assert rigid_volumes.size(name, numbers[0]) == pytest.approx(value)


def test_claims_are_judged_by_their_worst_figure():
    row = rigid_claims.at_least("ratio", 4, [5.0, 3.0])
    assert (row["measured"], row["met"]) == (3.0, False)
    row = rigid_claims.at_most("errors", 0, [0.0, 0.0])
    assert (row["measured"], row["met"]) == (0.0, True)
    assert rigid_claims.at_least("peer", 6, [7.0, None])["met"] is None


def test_a_wrong_answer_or_a_slow_cell_breaks_a_claim():
    names = ("abfme", "sat", "auto")
    cell = {
        "study": "table 2.1 static",
        "pair": "boxes-boxes",
        "outcome": "collision",
        "pairs": 100,
        "abfme_vs_textbook": 2.0,
        "published": 1.39,
        "auto_vs_sat": 0.9,
        "auto_vs_coal_net": 20.0,
        **{f"{n}_wrong": rate(int(n == "sat"), 100) for n in names},
    }
    hard = {"study": "hard cases", "pairs": 10}
    hard |= {f"{n}_{k}": 0 for n in names for k in ("false_hit", "false_clear")}
    batch = {"study": "batched box-box", "vectors_ns": {"median": 6.0}}
    rows = [cell, hard, batch]
    judged = rigid_claims.wrong_answers(rows) + rigid_claims.convex_ratios(rows)
    broken = {row["claim"] for row in judged if row["met"] is False}
    assert broken == {"sat: wrong of 100 pairs", "auto over tuned SAT, every cell"}


def test_a_quick_run_says_no_to_errors_only(monkeypatch):
    def judged(quick):
        asked = [("wrong", 0, [1.0]), ("t", 1e-7, [1e-6]), ("depth", 2.5e-6, [1e-5])]
        errors = [rigid_claims.error_at_most(*one) for one in asked]
        times = [rigid_claims.at_most("ns", 0, [12.0]), rigid_claims.at_least("ratio", 4, [3.0])]
        monkeypatch.setattr(rigid_claims, "wrong_answers", lambda rows: errors)
        monkeypatch.setattr(rigid_claims, "convex_ratios", lambda rows: times)
        monkeypatch.setattr(rigid_claims, "mesh_ratios", lambda rows, volume: [])
        monkeypatch.setattr(rigid_claims, "impacts", lambda rows: [])
        monkeypatch.setattr(rigid_claims, "distances", lambda rows: [])
        monkeypatch.setattr(rigid_claims, "rounded", lambda rows: [])
        return [row["met"] for row in rigid_claims.claims([], quick)]

    assert judged(quick=True) == [False, False, False, "full run", "full run"]
    assert judged(quick=False) == [False] * 5


def test_rows_of_rounded_bodies_and_a_mesh_stand_beside_coal():
    pytest.importorskip("coal")
    rng = np.random.default_rng(5)
    static = rigid_rounded.static_row(rng, ("capsules", "spheres"), 60, 20)
    assert (static["wrong"], static["signs_differ"]) == (0, 0)
    assert static["error"] < 3e-14
    assert static["coal_differs_most"] < 1e-6
    moving = rigid_rounded.moving_row(rng, ("capsules", "rounded boxes"), 20)
    assert (moving["passed_before"], moving["coal_disagrees"]) == (0, 0)
    assert moving["hits"] > 0
    assert moving["gap_at_toi"] < 1e-6
    mesh = rigid_mesh.generated(12)
    tree = MeshTree(mesh.vertices, mesh.faces)
    row = rigid_mesh_bodies.mesh_row(rng, mesh, tree, "boxes", 20)
    assert (row["signs_differ"], row["coal_disagrees"]["value"]) == (0, 0)
    assert row["coal_differs_most"] < 1e-6
    assert row["moving_passed_before"] == 0
    json.dumps([static, moving, row])


def test_pairs_that_overlap_at_the_start_hide_no_pair_that_met_too_early():
    toi = np.array([0.0, 0.0, 0.0, 0.5, np.inf])
    least = np.array([-1.0, 0.0, 0.0, -1.0, -1.0])
    assert coal_motion.passed_before(least, toi) == 2
    assert coal_motion.passed_before(np.abs(least), toi) == 0


def test_an_error_between_points_without_extent_is_a_number():
    truth, size = np.zeros(2), np.array([0.0, 2.0])
    assert rigid_gap.worst(np.array([0.0, 0.5]), truth, size) == 0.25
    assert rigid_gap.worst(np.array([1e-300, 0.5]), truth, size) == np.inf
