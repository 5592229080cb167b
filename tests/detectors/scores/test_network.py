"""The native network against scikit-learn's."""

import numpy as np
import pytest
from sklearn.neural_network import MLPRegressor

from tauguard.detectors import _network
from tauguard.detectors.scores.network import Network


@pytest.fixture(scope="module")
def data():
    rng = np.random.default_rng(3)
    x = rng.normal(size=(800, 7)) * 3 + 1
    return x, 2 * x[:, 0] + x[:, 1] * (x[:, 2] > 0)


def test_it_says_what_scikit_learn_says(data, monkeypatch):
    kept, real = [], MLPRegressor.fit

    def fit(self, x, y):
        kept.append(real(self, x, y))
        return kept[0]

    monkeypatch.setattr(MLPRegressor, "fit", fit)
    x, y = data
    network = Network.fit(x, y, (16, 8), seed=1, epochs=80)
    fresh = np.random.default_rng(4).normal(size=(500, 7)) * 3 + 1
    expected = kept[0].predict((fresh - x.mean(axis=0)) / x.std(axis=0)) * y.std() + y.mean()
    np.testing.assert_allclose(network(fresh)[:, 0], expected, rtol=0, atol=1e-9)
    assert np.corrcoef(network(x)[:, 0], y)[0, 1] > 0.7


def test_single_rows_give_the_same_bits(data):
    x, y = data
    network = Network.fit(x, y, (8,), seed=1, epochs=5)
    every = network(x)
    assert b"".join(network(x[i : i + 1]).tobytes() for i in range(50)) == every[:50].tobytes()


def test_tables_of_another_shape_are_refused():
    widths, one = np.array([2, 1]), np.ones(1)
    x, out, two = np.zeros((4, 2)), np.zeros((4, 1)), np.ones(2)
    for bad in (
        (np.zeros((4, 3)), widths, two, one, two, two),
        (x, widths, np.ones(3), one, two, two),
        (x, widths, two, two, two, two),
        (x, np.array([2, 0]), two, one, two, two),
    ):
        with pytest.raises(ValueError, match="network: "):
            _network.network(*bad, out, 1)
