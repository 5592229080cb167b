"""The one-class score against its sum."""

import numpy as np

from tauguard.detectors.scores.kernel import KernelMachine
from tauguard.detectors.scores.learned import Remoteness


def machine(sigma=3.0):
    rng = np.random.default_rng(0)
    return KernelMachine(rng.normal(size=(20, 4)), rng.uniform(0.1, 1, 20), 0.0, sigma)


def test_it_is_the_logarithm_of_the_sum():
    kernels, x = machine(), np.random.default_rng(1).normal(size=(50, 4))
    apart = ((x[:, None] - kernels.vectors) ** 2).sum(axis=2)
    sums = (kernels.weights / (1 + apart / kernels.sigma**2) ** 2).sum(axis=1)
    np.testing.assert_allclose(Remoteness(kernels)(x), -np.log(sums), rtol=1e-12)


def test_it_has_no_bound_far_from_all_vectors():
    ray = np.outer(10.0 ** np.arange(1, 9), np.ones(4))
    scores = Remoteness(machine())(ray)
    # The kernel falls with the fourth power of the distance.
    np.testing.assert_allclose(np.diff(scores)[2:], 4 * np.log(10), rtol=0.01)
    assert np.isfinite(Remoteness(machine())(np.full((1, 4), 1e200))).all()
