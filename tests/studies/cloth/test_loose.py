"""Queries of points, safe steps and lateness in the cloth study."""

import dataclasses

import pytest

from studies.cloth import frames, loose
from studies.cloth.scaling import scenes, step_at
from tauguard.cloth import MeshCCD


def test_point_queries_are_judged_by_rational_arithmetic():
    rows = loose.point_queries(60, 3, 1)
    assert [row["queries"] for row in rows] == ["drawn", "made to meet"] * 2
    for row in rows:
        assert (row["misses"], row["false_hits"], row["late"]) == (0, 0, 0)
        assert row["early_most"] <= 1e-9


def test_a_safe_step_stops_before_the_first_contact():
    pytest.importorskip("ipctk")
    for row in loose.safe_steps(200, 3, 1):
        assert row["step"] <= row["earliest"]
        assert row["step"] == 0 or row["meets_after"] == 0
        assert row["peer_step"] <= row["earliest"]


def test_late_times_are_counted_and_measured():
    scene = next(iter(scenes(400, 0)))
    found = MeshCCD(scene.faces, groups=scene.groups).find(*step_at(scene, 0.85))
    assert frames.lateness(found, found) == {"late": 0, "late_most": 0.0}
    toi = found.ee_impacts.toi.copy()
    toi[3] += 0.25
    later = dataclasses.replace(found, ee_impacts=dataclasses.replace(found.ee_impacts, toi=toi))
    assert frames.lateness(found, later) == {"late": 1, "late_most": pytest.approx(0.25)}
