"""Damaged files of every format: each ends in a right answer or in an error of one line."""

from collections import Counter

import pytest

from slow.damaged import Worker
from slow.formats import FORMATS

#: Damaged files of one format.
FILES = 600


@pytest.mark.slow
@pytest.mark.parametrize("kind", FORMATS)
def test_every_damaged_file_ends_in_a_right_answer_or_one_line(kind, slow_seed, counts):
    worker = Worker((kind,))
    try:
        found = [worker.tried(kind, (slow_seed, number)) for number in range(FILES)]
    finally:
        worker.close()
    slowest = max(outcome.seconds for outcome in found)
    counts(**Counter(outcome.said for outcome in found), slowest_s=round(slowest, 2))
    bad = {number: outcome for number, outcome in enumerate(found) if not outcome.ok}
    assert not bad
