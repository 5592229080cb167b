"""The online study: its peer is scikit-learn's predict, its counters count."""

from __future__ import annotations

import numpy as np
import pytest

from studies.detection.online import allocated, kernel_rows, peer, spread, timed
from tauguard.detectors.methods.svr_regressor import SrqSVR, srq_kernel


@pytest.fixture(scope="module")
def regressor():
    rng = np.random.default_rng(0)
    x = rng.normal(size=(150, 6))
    return SrqSVR().fit(x, np.abs(x).sum(axis=1)), x


def test_the_peer_is_scikit_learns_predict_on_the_whole_kernel_row(regressor):
    model, x = regressor
    fresh = np.random.default_rng(1).normal(size=(20, 6))
    whole = model.svr_.predict(srq_kernel(fresh, x))
    theirs = peer(model)
    one_by_one = [theirs(row[None])[0] for row in fresh]
    np.testing.assert_allclose(one_by_one, whole, rtol=0, atol=1e-12)


def test_the_full_set_has_no_error_and_fewer_vectors_have_some(regressor):
    model, _ = regressor
    windows = np.random.default_rng(2).normal(size=(100, 6))
    full, *fewer = kernel_rows(model, windows, 30, 0)
    assert full["support_vectors"] == len(model.machine_.vectors)
    assert full["error_max"] == 0.0
    assert full["difference_to_sklearn"] < 1e-9
    counts = [row["support_vectors"] for row in fewer]
    assert counts == sorted(counts, reverse=True)
    assert 0 < fewer[0]["error_rms"] < fewer[-1]["error_rms"]
    assert all(row["us"]["low"] <= row["us"]["median"] <= row["us_p99"] for row in fewer)


def test_memory_that_a_call_keeps_is_seen():
    kept: list[bytes] = []
    assert allocated(lambda k: kept.append(bytes(1000)), 100) > 1000
    assert allocated(lambda k: None, 1000) < 1


def test_times_are_microseconds_in_order():
    spent = timed(lambda k: sum(range(20_000 if k else 0)), 2)
    assert 0 <= spent[0] < spent[1]
    row = spread(np.array([1.0, 2.0, 3.0]))
    assert (row["low"], row["median"], row["high"]) == (1.5, 2.0, 2.5)
