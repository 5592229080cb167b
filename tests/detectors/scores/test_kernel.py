"""The SRQ regressor: scikit-learn's contract, the kernel's definition, direct evaluation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.svm import SVR
from sklearn.utils.estimator_checks import parametrize_with_checks

from tauguard.detectors import _kernel
from tauguard.detectors.scores.kernel import SrqRegressor, srq_kernel


@parametrize_with_checks([SrqRegressor()])
def test_scikit_learn_contract(estimator, check):
    check(estimator)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**31), d=st.integers(1, 50), sigma=st.floats(0.1, 30))
def test_kernel_is_its_definition(seed, d, sigma):
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(7, d)), rng.normal(size=(5, d))
    truth = (1 + ((a[:, None] - b[None]) ** 2).sum(-1) / sigma**2) ** -2.0
    np.testing.assert_allclose(srq_kernel(a, b, sigma), truth, rtol=1e-12)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**31), n=st.integers(5, 200), d=st.integers(1, 44))
def test_direct_evaluation_equals_scikit_learn(seed, n, d):
    rng = np.random.default_rng(seed)
    x, y = rng.normal(size=(n, d)), rng.normal(size=n)
    ours = SrqRegressor().fit(x, y)

    def kernel(a, b):
        return (1 + ((a[:, None] - b[None]) ** 2).sum(-1) / 9) ** -2.0

    theirs = SVR(kernel=kernel, C=1.0, epsilon=0.02).fit(x, y)
    fresh = rng.normal(size=(30, d))
    np.testing.assert_allclose(ours.predict(fresh), theirs.predict(fresh), atol=2e-3)  # solver's
    same = ours.svr_.predict(srq_kernel(fresh, x))
    np.testing.assert_allclose(ours.predict(fresh), same, rtol=0, atol=1e-9)


def test_same_bits_for_any_number_of_threads_and_row_by_row():
    rng = np.random.default_rng(0)
    model = SrqRegressor().fit(rng.normal(size=(300, 8)), rng.normal(size=300))
    signal = np.ascontiguousarray(rng.normal(size=(1500, 2)))
    kernel = model.machine_.native
    windows = np.empty((1500, 8))
    _kernel.windows(signal, np.arange(1500), 3, 4, windows)
    outs = []
    for threads in (1, 2, 5):
        out = np.empty(1500)
        kernel.rows(windows, out, threads)
        outs.append(out)
    assert outs[0].tobytes() == outs[1].tobytes() == outs[2].tobytes()
    one = np.array([model.predict(w[None])[0] for w in windows[:200]])
    assert one.tobytes() == outs[0][:200].tobytes()


def test_an_output_that_would_be_copied_is_refused():
    with pytest.raises(TypeError):
        _kernel.gram(np.zeros((3, 2)), np.zeros((4, 2)), 1.0, np.zeros((4, 3)).T, 1)


def test_bad_input():
    with pytest.raises(ValueError, match="expected \\(N, d\\) and \\(M, d\\)"):
        srq_kernel(np.zeros((3, 2)), np.zeros((3, 4)))
    with pytest.raises(ValueError, match="sigma: 0"):
        srq_kernel(np.zeros((3, 2)), np.zeros((3, 2)), 0.0)
