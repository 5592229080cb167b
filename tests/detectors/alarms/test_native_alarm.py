"""The native alarm beside the batch form: levels, speed, threshold, confirmation, settling."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tauguard.detectors import _observer
from tauguard.detectors.events import confirmed
from tauguard.detectors.thresholds.free_scores import (
    SpeedNormalisation,
    memory_samples,
    recent_speed,
)

DT = 2e-3


class Told:
    """A Python stream that gives these scores in turn and keeps what it was asked."""

    def __init__(self, scores):
        self.scores, self.asked = iter(scores), []

    def step(self, q, qd, current, dt):
        self.asked.append((q, qd, current, dt))
        return next(self.scores)


def native(told, joints, settle, threshold, samples, memory, levels):
    columns = (levels.speed, levels.base, levels.unit) if levels else ([], [], [])
    none = _observer.Levels([], [], [])
    scores = _observer.python_scores(lambda: told, joints)
    levels = _observer.Levels(*([float(x) for x in column] for column in columns))
    return _observer.Alarm(scores, DT, settle, threshold, samples, memory, levels, none)


@given(
    st.integers(0, 2**32),
    st.integers(1, 20),
    st.integers(0, 4),
    st.integers(1, 5),
    st.floats(0, 0.05),
    st.booleans(),
)
def test_sample_by_sample_it_has_the_bits_of_the_batch_form(
    seed, joints, knots, samples, memory, repeated
):
    rng = np.random.default_rng(seed)
    count = 120
    qd = rng.normal(size=(count, joints)) * 10.0 ** rng.integers(-3, 2)
    if repeated:  # equal maxima, and speeds that are exactly those of the levels
        qd = np.round(qd)
    scores, levels = rng.normal(size=count), None
    if knots:
        speed = np.sort(np.round(rng.uniform(0, np.abs(qd).sum(axis=1).max(), knots)))
        base = np.sort(rng.normal(size=knots))
        levels = SpeedNormalisation(speed, base, np.sort(rng.uniform(0.1, 3, knots)))
    told = Told(scores.tolist())
    alarm = native(told, joints, 0.02, 0.3, samples, memory_samples(DT, memory), levels)
    up, normalised = [], []
    for k in range(count):
        up.append(alarm.step(qd[k], qd[k], -qd[k], DT))
        normalised.append(alarm.score)
    expected = scores if levels is None else levels(scores, recent_speed(qd, DT, memory))
    assert np.array(normalised).tobytes() == expected.tobytes()
    time = np.concatenate([[0.0], np.cumsum(np.full(count - 1, DT))])
    assert up == confirmed((expected > 0.3) & (time > 0.02), samples).tolist()
    # A stream of Python's own gets copies: it may keep them.
    assert all((asked[1] == row).all() for asked, row in zip(told.asked, qd, strict=True))


def test_what_does_not_fit_is_refused():
    one = np.zeros(2)
    alarm = native(Told([1.0, np.nan]), 2, 0.0, 0.5, 1, 1, None)
    with pytest.raises(ValueError, match="q: expected one entry per joint"):
        alarm.step(np.zeros(3), one, one, DT)
    with pytest.raises(ValueError, match="qd: every entry must be finite"):
        alarm.step(one, np.array([0.0, np.inf]), one, DT)
    with pytest.raises(ValueError, match="dt: must be above 0"):
        alarm.step(one, one, one, 0.0)
    alarm.step(one, one, one, DT)
    with pytest.raises(ValueError, match="the score is not a number"):
        alarm.step(one, one, one, DT)
    with pytest.raises(ValueError, match="dt, samples, memory"):
        native(Told([]), 2, 0.0, 0.5, 0, 1, None)
    with pytest.raises(ValueError, match="as many of each"):
        _observer.Levels([1.0], [], [])


def test_an_error_of_a_python_stream_is_its_own():
    alarm = native(Told([]), 2, 0.0, 0.5, 1, 1, None)
    with pytest.raises(StopIteration):
        alarm.step(*np.zeros((3, 2)), DT)
