"""Guarded scenes of every family, edited between steps: nothing passes unreported."""

import pytest

from slow.guarded_jobs import played

#: So many take some 20 minutes of processor time.
SCENES = 10_000

pytestmark = pytest.mark.slow


def test_nothing_passes_unreported(slow_seed, counts):
    total, silent = played(slow_seed, SCENES)
    counts(**total, silent=len(silent))
    assert not silent, silent[:10]
    assert total["plain_lost"] > total["plain"] / 4
