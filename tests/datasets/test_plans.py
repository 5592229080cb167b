"""Speeds and payloads of a data set: both in turn, and every pair of them."""

from itertools import product

from hypothesis import given
from hypothesis import strategies as st

from tauguard.datasets.plans import pairing


@given(st.integers(1, 7), st.integers(1, 7))
def test_every_pair_comes_equally_often(speeds, payloads):
    fast, heavy = range(1, speeds + 1), [100.0 * k for k in range(payloads)]
    pairs = [pairing(i, fast, heavy) for i in range(speeds * payloads)]
    assert sorted(pairs) == sorted(product(map(float, fast), heavy))
    assert [p[0] for p in pairs[:speeds]] == [float(s) for s in fast]
