"""From the dissertation's form to ours: the ends are what they say, and every row is one change."""

from dataclasses import fields, replace

import numpy as np
import pytest

from studies.detection import ladder
from studies.detection.fleet import Training
from studies.detection.rows import DISSERTATION
from tauguard.detectors import PlainSrqSvr, SrqSvr
from tauguard.detectors.calibration.nominal import nominal_design
from tauguard.report import table


@pytest.fixture(scope="module")
def slices():
    return Training(slices=2, collisions=2, free=2, free_seconds=10.0).traces(0, 5)


def test_the_ends_are_the_dissertations_form_and_ours(slices):
    ends = {0: PlainSrqSvr(windows=300), 5: SrqSvr(windows=300)}
    for parts, named in ends.items():
        form = replace(ladder.FULL, windows=300).form(parts)
        scores, expected = (
            one.fit(slices, nominal_design()).scores(slices[0]) for one in (form, named)
        )
        assert np.array_equal(scores, expected)
        assert np.ptp(scores) > 0


def test_every_rung_changes_one_thing():
    names = [field.name for field in fields(ladder.Rung) if field.name != "change"]
    for before, after in zip(ladder.RUNGS, ladder.RUNGS[1:], strict=False):
        assert sum(getattr(before, name) != getattr(after, name) for name in names) == 1
    scenes = [
        {field.name for field in fields(a) if getattr(a, field.name) != getattr(b, field.name)}
        for a, b in zip(ladder.SCENES, ladder.SCENES[1:], strict=False)
    ]
    assert scenes == [{"scale"}, {"without"}, {"payloads"}]
    parts = [
        {
            field.name
            for field in fields(ladder.Form)
            if getattr(ladder.FULL.form(k), field.name)
            != getattr(ladder.FULL.form(k + 1), field.name)
        }
        for k in range(5)
    ]
    assert parts == [
        {"graded"},
        {"front"},
        {"front"},
        {"envelope", "distance"},
        {"mined", "vectors"},
    ]


def test_the_dissertations_specificity():
    assert ladder.specificity(*DISSERTATION[10.0][0]) == pytest.approx(113 / 142)


def test_a_small_run_prints_a_row_for_every_rung(monkeypatch, tmp_path):
    little = Training(slices=2, collisions=2, free=2, free_seconds=8.0)
    size = replace(ladder.QUICK, training=little, hours=0.001, windows=200, mined=20)
    monkeypatch.setattr(ladder, "QUICK", size)
    monkeypatch.setattr(ladder, "RUNGS", tuple(ladder.RUNGS[k] for k in (4, 6, 11)))
    monkeypatch.setattr(ladder, "SCENES", ladder.SCENES[3:])
    monkeypatch.setattr(ladder, "RUNGS", tuple(replace(r, scene=0) for r in ladder.RUNGS))
    monkeypatch.setattr(ladder, "Workers", lambda: _in_place())
    rows = ladder.measure(True, 0, str(tmp_path))
    assert [row["change"] for row in rows] == [rung.change for rung in ladder.RUNGS]
    assert rows == ladder.measure(True, 0, str(tmp_path))
    for row in rows:
        assert row["from 32 N m"]["n"] <= row["from 16 N m"]["n"] <= row["from 4 N m"]["n"]
        assert row["from 4 N m"]["n"] > 0
    assert "kilohertz" in table(rows, notes=ladder.NOTES)
    ladder.draw(rows, pytest.importorskip("matplotlib.figure").Figure())


def _in_place():
    from studies.framework import Workers

    return Workers(1)
