"""The native forest against the trees that it was made from."""

import numpy as np
import pytest
from sklearn.ensemble import GradientBoostingRegressor

from tauguard.detectors import _ranking
from tauguard.detectors.scores.regressors import Forest


@pytest.fixture(scope="module")
def data():
    rng = np.random.default_rng(3)
    x = rng.normal(size=(800, 7))
    return x, np.sin(x[:, 0]) + x[:, 1] * (x[:, 2] > 0)


def test_it_says_what_scikit_learn_says(data, monkeypatch):
    kept = []
    real = GradientBoostingRegressor.fit

    def fit(self, x, y):
        kept.append(real(self, x, y))
        return kept[0]

    monkeypatch.setattr(GradientBoostingRegressor, "fit", fit)
    x, y = data
    forest = Forest.boosted(x, y, trees=30, depth=4, rate=0.1, seed=1)
    fresh = np.random.default_rng(4).normal(size=(500, 7))
    expected = kept[0].predict(fresh) + y.mean()
    np.testing.assert_allclose(forest(fresh), expected, rtol=0, atol=1e-12)
    assert np.corrcoef(forest(x), y)[0, 1] > 0.9


def test_threads_and_single_rows_give_the_same_bits(data):
    x, y = data
    forest = Forest.boosted(x, y, trees=10, depth=3, rate=0.2, seed=1)
    one = forest(x, threads=1)
    assert forest(x, threads=3).tobytes() == one.tobytes()
    assert b"".join(forest(x[i : i + 1]).tobytes() for i in range(50)) == one[:50].tobytes()


def test_damaged_tables_are_refused():
    ids, value = np.array([0, 1, 2]), np.zeros(3)
    x, out = np.zeros((1, 2)), np.zeros(1)
    root, feature = np.array([0]), np.array([0, 0, 0])
    for left, right, message in (
        (np.array([1, 1, 2]), np.array([9, 1, 2]), "child"),
        (np.array([1, 0, 2]), np.array([2, 1, 2]), "child"),
    ):
        with pytest.raises(ValueError, match=message):
            _ranking.forest(x, root, feature, value, left, right, value, 0.0, out, 1)
    with pytest.raises(ValueError, match="feature"):
        _ranking.forest(x, root, feature + 2, value, ids, ids, value, 0.0, out, 1)
    with pytest.raises(ValueError, match="root"):
        _ranking.forest(x, root + 3, feature, value, ids, ids, value, 0.0, out, 1)
    with pytest.raises(ValueError, match=r"expected \(N, 2\)"):
        Forest(root, feature, value, ids, ids, value, 0.0, 2)(np.zeros((4, 3)))
