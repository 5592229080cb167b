"""A drive's numbers as text: an equal drive again, and other text refused."""

import json

import numpy as np
import pytest

from tauguard.models import Drive, cura6_drive, drive_of, drive_text, load_arm
from tests.models.arms import random_arm


@pytest.mark.parametrize("kind", ["whole", "ideal", "described"])
def test_the_same_numbers_come_back(kind, tmp_path):
    (tmp_path / "arm.xml").write_text(random_arm(1))
    (tmp_path / "arm.toml").write_text('file = "arm.xml"\n[drive]\nlike = "cura6"\n')
    drive = {
        "whole": cura6_drive,
        "ideal": lambda: Drive.ideal(np.array([3.0, np.inf])),
        "described": lambda: load_arm(str(tmp_path / "arm.toml")).facts.drive,
    }[kind]()
    text = drive_text(drive)
    json.loads(text, parse_constant=pytest.fail)  # no number that JSON does not have
    again = drive_of(text)
    assert drive_text(again) == text
    np.testing.assert_array_equal(again.current_limit, drive.current_limit)
    assert (again.friction is None) == (drive.friction is None)
    if drive.friction is not None:
        np.testing.assert_array_equal(again.friction.static, drive.friction.static)
    if drive.ripple is not None:
        np.testing.assert_array_equal(again.ripple.amplitude, drive.ripple.amplitude)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda v: v | {"version": 2}, "of version 2; this tauguard reads 1"),
        (lambda v: v | {"torque": 1}, "not the numbers of a drive"),
        (lambda v: {k: x for k, x in v.items() if k != "gain"}, "not the numbers of a drive"),
        (lambda v: v | {"gear": [1.0]}, "gear"),
        (lambda v: [v], "not the numbers of a drive"),
    ],
)
def test_other_text_is_refused(change, message):
    values = json.loads(drive_text(cura6_drive()))
    with pytest.raises(ValueError, match=message):
        drive_of(json.dumps(change(values)))
