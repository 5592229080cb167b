"""Collision-free scores reduced to pieces, and the threshold for a rate."""

import numpy as np
import pytest

from tauguard.detectors import CollisionAlarm
from tauguard.detectors.thresholds.free_scores import PIECE, FreeScores
from tauguard.detectors.thresholds.tail_model import threshold_for_rate
from tauguard.traces import Trace


class Given:
    """A detector whose score is the first joint's current."""

    name, settle, dt = "given", 0.0, 1e-3

    def scores(self, trace):
        return trace.current[:, 0]


def test_pieces_agree_with_scores_looked_at_one_by_one():
    rng = np.random.default_rng(1)
    score, t = rng.normal(size=20_000), np.arange(20_000) * 1e-3
    trace = Trace(("j",), t, *(x[:, None] for x in (t, np.maximum(t, 0), score)))
    found = CollisionAlarm(Given(), np.inf, confirmation=0.0).free_scores(trace)
    assert found.seconds == pytest.approx(20)
    assert len(found.peaks) == 1000
    assert len(found.cases()) == 10
    assert len(found.blocks()[0]) == 40
    for k in range(10):
        assert found.cases()[k] == score[2000 * k : 2000 * (k + 1)].max()
    for speed, high in zip(found.speeds, found.peaks, strict=True):
        assert score[round(speed / 1e-3)] == high
    short = CollisionAlarm(Given(), np.inf, confirmation=3e-3).free_scores(trace)
    lowest = np.lib.stride_tricks.sliding_window_view(score, 3).min(axis=-1)
    assert short.peak == lowest.max()


@pytest.mark.parametrize("hz", [1000.0, 500.0, 125.0, 23.8, 10.0])
def test_blocks_and_cases_last_as_long_at_every_sample_rate(hz):
    rng = np.random.default_rng(2)
    t = np.arange(round(120 * hz)) / hz
    score = rng.normal(size=len(t))
    trace = Trace(("j",), t, *(x[:, None] for x in (t, t, score)))
    found = CollisionAlarm(Given(), np.inf, confirmation=0.0).free_scores(trace)
    assert found.seconds == pytest.approx(120)
    assert len(found.peaks) * found.piece == pytest.approx(120, rel=0.01)
    assert found.seconds / len(found.blocks()[0]) == pytest.approx(0.5, rel=0.05)
    assert found.seconds / len(found.cases()) == pytest.approx(2.0, rel=0.05)
    # Alarms 0.4 s apart are one, those 0.9 s apart are two.
    for apart, alarms in ((0.4, 1), (0.9, 2)):
        score[:] = 0
        score[np.searchsorted(t, (5.0, 5.0 + apart))] = 1
        found = CollisionAlarm(Given(), np.inf, confirmation=0.0).free_scores(trace)
        assert found.alarms(0.5) == alarms


@pytest.mark.parametrize(
    ("draw", "level"),
    [
        (lambda rng, n: (rng.random(n) ** -0.2 - 1) / 0.2, lambda p: (p**-0.2 - 1) / 0.2),
        # It ends: nothing to extrapolate to.
        (lambda rng, n: rng.uniform(size=n), lambda p: 1 - p),
    ],
)
def test_the_threshold_for_a_rate_lies_on_the_tail(draw, level):
    blocks = draw(np.random.default_rng(0), 7200)
    pieces = np.repeat(blocks, round(0.5 / PIECE))
    free = [FreeScores(pieces, np.zeros_like(pieces), len(pieces) * PIECE)]
    for per_hour in (5.0, 0.5, 0.1):
        assert threshold_for_rate(free, per_hour) == pytest.approx(level(per_hour / 7200), rel=0.25)
    assert np.sum(blocks > threshold_for_rate(free, 720.0)) == 720
    with pytest.raises(ValueError, match="per_hour: 0"):
        threshold_for_rate(free, 0)
