"""Alarms beside labelled contacts: cases that were counted by hand."""

import pytest

from tauguard.detectors.evaluation.labelled_log import compare_with_labels, labels_text
from tauguard.traces import Alarm


def test_each_contact_is_found_held_or_missed() -> None:
    touched = [(0.5, 0.8), (2.0, 2.1), (2.3, 2.6), (4.0, 5.0), (7.0, 7.2)]
    alarms = [
        Alarm(2.35, 4.5),  # of the third, 50 ms late; still up when the fourth begins
        Alarm(5.5, 5.6),  # a repeat: half a second after the release of the fourth
        Alarm(6.1, 6.2),  # false
        Alarm(7.4, 7.5),  # of the last: 0.4 s after its onset, after its end
    ]
    found = compare_with_labels(alarms, touched, 1.0, 10.0)
    assert (found["contacts"], found["found"], found["still_up"]) == (4, 2, 1)
    assert found["missed"] == [2.0]
    assert found["delays"] == pytest.approx([0.05, 0.4])
    assert (found["false_alarms"], found["repeats"]) == (1, 1)
    # Free: 1.8 (a second after the first's release) to 1.95, 3.6 to 3.95, 6.0 to 6.95, from 8.2.
    assert found["free_seconds"] == pytest.approx(0.15 + 0.35 + 0.95 + 1.8)
    assert labels_text(found, 1.0) == (
        "labels: 4 contacts, 2 found (225 ms after the onset in the median, at most 400 ms), "
        "1 began during an earlier alarm (not found), 1 missed (at 1.00 s); "
        "1 false alarm in the 3.3 s without contact"
    )


def test_a_log_without_contacts_has_false_alarms_only() -> None:
    found = compare_with_labels([Alarm(1.0, 1.1), Alarm(2.0, 2.1)], [], 0.0, 4.0)
    assert labels_text(found) == (
        "labels: 0 contacts, 0 found, 0 missed; 2 false alarms in the 4.0 s without contact"
    )
