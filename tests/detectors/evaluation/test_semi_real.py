"""Contacts that are added to a log: the drive supplies what they take."""

from dataclasses import replace

import numpy as np
import pytest

from tauguard.detectors.evaluation.semi_real import Added, add_contact
from tests.detectors.synthetic_arm import GAIN, record


def test_the_current_changes_by_the_torque_over_the_gain():
    trace, torque = record(2, seconds=12.0), (3.0, -2.0, 1.0)
    struck = add_contact(trace, GAIN, Added(10.0, 0.6, torque))
    taken = (trace.current - struck.current) * GAIN
    for t in (10.05, 10.3, 10.5):
        row = int(np.searchsorted(trace.t, t))
        phase = np.sin(np.pi * (trace.t[row] - 10.0) / 0.6)
        assert taken[row] == pytest.approx(phase * np.array(torque), abs=1e-9)
    assert not taken[(trace.t < 10.0) | (trace.t > 10.6)].any()
    assert struck.meta["collisions"] == "semi-real"


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"seconds": 0.0}, "more than 0 s"),
        ({"torque": (1.0,)}, "3 torques"),
        ({"shape": "kick"}, "impact or push"),
    ],
)
def test_what_is_no_contact_is_refused(wrong, words):
    contact = replace(Added(1.0, 0.5, (1.0, 1.0, 1.0)), **wrong)
    with pytest.raises(ValueError, match=words):
        add_contact(record(2, seconds=3.0), GAIN, contact)
