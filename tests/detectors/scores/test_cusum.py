"""CUSUM against its recursion."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tauguard.detectors.scores.baselines import bounded_cusum


@settings(deadline=None)
@given(
    arrays(float, st.tuples(st.integers(0, 60), st.integers(1, 3)), elements=st.floats(-9, 9)),
    st.floats(0, 20),
)
def test_it_is_the_recursion(x, cap):
    out = bounded_cusum(x, cap)
    for column in range(x.shape[1]):
        g = 0.0
        for row in range(len(x)):
            before = min(g, cap) if x[row, column] < 0 else g
            g = max(0.0, before + x[row, column])
            assert out[row, column] == g


def test_a_lasting_small_shift_passes_a_short_large_one():
    lasting, short = np.full((200, 1), -0.5), np.full((200, 1), -0.5)
    lasting[100:] = 0.2
    short[100:103] = 3.0
    assert bounded_cusum(lasting, np.inf).max() > bounded_cusum(short, np.inf).max()


def test_while_a_deviation_lasts_nothing_bounds_it():
    assert bounded_cusum(np.ones((500, 1)), 3.0)[-1, 0] == 500


def test_it_recovers_from_a_long_contact_in_the_time_that_the_bound_gives():
    drift, rows = 2.0, 5000
    x = np.full((rows + 300, 1), -drift)
    x[:rows] = 50.0
    after = bounded_cusum(x, 100 * drift)[rows:, 0]
    assert after[98] > 0
    assert after[100] == 0
