"""Windows, envelope, scaling, and what a sample rate cannot carry."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.detectors import _kernel
from tauguard.detectors.calibration.calibrate import free_rows
from tauguard.detectors.features.windows import (
    Envelope,
    Features,
    WindowShape,
    median_distance,
)
from tauguard.detectors.methods.svr_regressor import srq_kernel


def test_the_dissertations_window_is_44_numbers():
    shape = WindowShape.at(1e-3, confirmation=3e-3)
    assert (shape.lag, shape.count, shape.note) == (8, 11, "")
    assert Features((0, 1, 2, 3), shape, None).size == 44


@pytest.mark.parametrize(
    ("dt", "lag", "words"),
    [
        (10e-3, 1, ["t_I = 8 ms is 1 sample", "t_c = 3 ms is 1 sample", "spans 100 ms"]),
        (42e-3, 1, ["at 42 ms", "spans 420 ms"]),
        (4e-3, 2, ["t_c = 3 ms is 1 sample"]),
        (2e-3, 4, ["t_c = 3 ms is 2 samples"]),
    ],
)
def test_what_a_rate_cannot_carry_is_counted_in_samples_and_said(dt, lag, words):
    shape = WindowShape.at(dt, confirmation=3e-3)
    assert shape.lag == lag
    assert shape.count == 11
    for word in words:
        assert word in shape.note


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**31), lag=st.integers(1, 5), count=st.integers(1, 6))
def test_windows_are_causal_and_equal_to_a_plain_gather(seed, lag, count):
    rng = np.random.default_rng(seed)
    signal = rng.normal(size=(40, 3))
    features = Features((0, 1, 2), WindowShape(lag, count), None)
    windows = features.windows(signal, np.arange(40))
    for t in range(40):
        rows = [max(0, t - k * lag) for k in reversed(range(count))]
        expected = signal[rows].T.ravel()
        np.testing.assert_array_equal(windows[t], expected)
    changed = signal.copy()
    changed[25:] += 1
    np.testing.assert_array_equal(features.windows(changed, np.arange(25)), windows[:25])


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**31),
    lag=st.integers(1, 5),
    count=st.integers(1, 6),
    envelope=st.booleans(),
    compress=st.booleans(),
)
def test_sliding_is_the_kernel_sum_of_every_window(seed, lag, count, envelope, compress):
    rng = np.random.default_rng(seed)
    left, qd, acceleration = rng.normal(size=(3, 50, 4)) * 3
    known = Envelope(rng.uniform(0.1, 1, (4, 4))) if envelope else None
    features = Features((0, 2, 3), WindowShape(lag, count), known, 0.7, 5.0, compress)
    vectors, weights = rng.normal(size=(9, features.size)), rng.normal(size=9)
    windows = features.windows(features.signal(left, qd, acceleration), np.arange(50))
    truth = 0.3 + srq_kernel(windows, vectors, 2.0) @ weights
    sliding = features.sliding(_kernel.KernelSum(vectors, weights, 0.3, 2.0))
    for _ in range(2):  # and once more from the beginning
        rows = zip(left, qd, acceleration, strict=True)
        values = [sliding.step(*row) for row in rows]
        np.testing.assert_allclose(values, truth, rtol=0, atol=1e-12)
        sliding.reset()


def test_sliding_refuses_joints_that_are_not_there():
    features = Features((0, 5), WindowShape(1, 1), None)
    sliding = features.sliding(_kernel.KernelSum(np.zeros((1, 2)), np.ones(1), 0.0, 1.0))
    with pytest.raises(ValueError, match="one number a joint"):
        sliding.step(np.zeros(4), np.zeros(4), np.zeros(4))
    with pytest.raises(ValueError, match="one number a joint"):
        sliding.step(np.zeros(6), np.zeros(5), np.zeros(6))


def test_envelope_finds_what_the_noise_grows_with():
    rng = np.random.default_rng(0)
    qd, acceleration = rng.normal(size=(2, 20000, 2))
    truth = np.array([[1.0, 0.5, 0.0, 0.0], [0.2, 0.0, 0.3, 0.1]])
    scale = Envelope(truth).scale(qd, acceleration)
    left = scale * rng.normal(size=qd.shape)
    fitted = Envelope.fit(left, qd, acceleration)
    np.testing.assert_allclose(fitted.weights, truth, atol=0.06)
    assert np.std(left / fitted.scale(qd, acceleration), axis=0) == pytest.approx([1, 1], abs=0.03)


def test_a_joint_without_any_residual_keeps_a_scale_above_zero():
    silent = Envelope.fit(np.zeros((100, 1)), np.ones((100, 1)), np.ones((100, 1)))
    assert (silent.scale(np.zeros(1), np.zeros(1)) > 0).all()


def test_scaling_brings_the_median_distance_to_what_was_asked(detector, training):
    trace = training[-1]
    f, estimate = detector.features, detector._estimate(trace)
    signal = f.signal(estimate.left, trace.qd, estimate.acceleration)
    struck = np.flatnonzero(np.abs(trace.truth.tau_ext[:, :4]).max(axis=1) > 2)
    free = np.flatnonzero(free_rows(trace, 3.0))[::7]
    rng = np.random.default_rng(0)
    distance = median_distance(f.windows(signal, struck), f.windows(signal, free), rng)
    assert 0.5 < distance / detector.settings.distance < 2  # one trace out of two
    raw = Features(f.joints, f.shape, None)
    plain = raw.signal(estimate.residual, trace.qd, estimate.acceleration)
    np.testing.assert_array_equal(plain, estimate.residual[:, :4])
    far = median_distance(raw.windows(plain, struck), raw.windows(plain, free), rng)
    assert far > 20  # raw N m, for a kernel of length 3


def test_bad_window():
    with pytest.raises(ValueError, match=r"dt 0\.0, t_I"):
        WindowShape.at(0.0)
