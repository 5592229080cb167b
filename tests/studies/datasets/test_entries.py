"""The table of the fixed dataset: what is pooled, and which dataset it is."""

import matplotlib.figure
import numpy as np
import pytest

from studies.datasets.entries import Entry, configuration, draw, rows_of
from tauguard.datasets.configuration import load
from tauguard.detectors import match
from tauguard.traces import Alarm, Collision


def matched(found, start=2.0):
    """Ten seconds with one collision of 20 N m at ``start``, and an alarm 10 ms later or none."""
    struck = Collision(
        "strike", start, start + 0.1, 2, np.zeros(3), np.array([100.0, 0.0, 0.0]), 20.0
    )
    alarms = [Alarm(start + 0.01, start + 0.1)] if found else []
    return match(alarms, [struck], (0.0, 10.0))


def test_all_arms_of_a_split_are_judged_together():
    entries = [
        Entry("mine", arm, seconds, (("test", (matched(found),)),))
        for arm, seconds, found in (("a", 1.0, True), ("b", 3.0, False))
    ]
    (row,) = rows_of("mine", entries)
    assert row["from_16"]["value"] == 0.5
    assert row["from_16"]["n"] == 2
    assert row["median"] == pytest.approx(10, abs=1)
    assert row["train_s"] == 2.0
    figure = matplotlib.figure.Figure(layout="constrained")
    draw([row], figure)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["mine"]


def test_seed_0_is_the_dataset_that_is_published():
    assert configuration(False, 0) == load("tauguard-collisions-v1").quick()
    assert configuration(False, 1).identity != configuration(False, 0).identity
    assert configuration(True, 0).hours < 0.5
