"""Windows of a signal, and its scaling."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.detectors.estimation.noise_model import NoiseModel
from tauguard.detectors.events import free_rows
from tauguard.detectors.features.front_end import Scaling
from tauguard.detectors.features.windows import WindowShape, median_distance


@pytest.mark.parametrize(
    ("dt", "lag", "count"),
    [(1e-3, 8, 11), (10e-3, 1, 9), (42e-3, 1, 3), (4e-3, 2, 11), (2e-3, 4, 11)],
)
def test_the_dissertations_window_in_whole_samples(dt, lag, count):
    shape = WindowShape.at(dt)
    assert (shape.lag, shape.count) == (lag, count)
    assert shape.of(np.zeros((5, 4)), [4]).shape == (1, 4 * count)
    assert shape.of(np.zeros((5, 4)), []).shape == (0, 4 * count)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**31), lag=st.integers(1, 5), count=st.integers(1, 6))
def test_windows_are_causal_and_equal_to_a_plain_gather(seed, lag, count):
    rng = np.random.default_rng(seed)
    signal = rng.normal(size=(40, 3))
    shape = WindowShape(lag, count)
    windows = shape.of(signal, np.arange(40))
    for t in range(40):
        rows = [max(0, t - k * lag) for k in reversed(range(count))]
        expected = signal[rows].T.ravel()
        np.testing.assert_array_equal(windows[t], expected)
    changed = signal.copy()
    changed[25:] += 1
    np.testing.assert_array_equal(shape.of(changed, np.arange(25)), windows[:25])


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**31), joints=st.integers(1, 12), envelope=st.booleans())
def test_scaling_is_its_formula_row_by_row(seed, joints, envelope):
    rng = np.random.default_rng(seed)
    left, qd = rng.normal(size=(2, 50, joints)) * 3
    motion = np.abs(rng.normal(size=(50, 4, joints)))
    known = NoiseModel(rng.uniform(0.1, 1, (joints, 6))) if envelope else None
    chosen = (0, joints - 1)
    scaling = Scaling(chosen, known, 5.0, 0.7, compress=True)
    truth = 0.7 * left[:, chosen]
    if known:
        truth = 0.7 * np.arcsinh(left / (5.0 * known.scale(qd, motion)))[:, chosen]
    whole = scaling.rows(left, qd, motion)
    np.testing.assert_allclose(whole, truth, rtol=1e-14)
    for t in range(50):
        one = scaling.rows(*(x[t : t + 1] for x in (left, qd, motion)))
        assert one.tobytes() == whole[t].tobytes()


def test_scaling_refuses_joints_that_are_not_there():
    for joints, size in (((0, 5), 4), ((0, -1), 4)):
        scaling = Scaling(joints, None)
        with pytest.raises(ValueError, match="one number per joint"):
            scaling.rows(*np.zeros((2, 1, size)), np.zeros((1, 4, size)))
    with pytest.raises(ValueError, match="one number per joint"):
        Scaling((0,)).rows(np.zeros((1, 6)), np.zeros((1, 5)), np.zeros((1, 4, 6)))
    with pytest.raises(ValueError, match="expected some joints"):
        Scaling(())


def test_envelope_finds_what_the_noise_grows_with():
    rng = np.random.default_rng(0)
    qd, motion = rng.normal(size=(20000, 2)), np.exp(rng.normal(size=(20000, 4, 2)))
    truth = np.array([[1.0, 0.5, 0.0, 0.3, 0.0, 0.2], [0.2, 0.0, 0.3, 0.0, 0.2, 0.0]])
    scale = NoiseModel(truth).scale(qd, motion)
    left = scale * rng.normal(size=qd.shape)
    fitted = NoiseModel.fit(left, qd, motion)
    np.testing.assert_allclose(fitted.weights, truth, atol=0.06)
    assert np.std(left / fitted.scale(qd, motion), axis=0) == pytest.approx([1, 1], abs=0.03)


def test_a_joint_without_any_residual_keeps_a_scale_above_zero():
    silent = NoiseModel.fit(np.zeros((100, 1)), np.ones((100, 1)), np.ones((100, 4, 1)))
    assert (silent.scale(np.zeros(1), np.zeros((4, 1))) > 0).all()


def test_scaling_brings_the_median_distance_to_what_was_asked(alarm, training):
    trace, own = training[-1], alarm.detector
    estimate = own.front.estimate(trace)
    struck = np.flatnonzero(np.abs(trace.truth.tau_ext[:, :4]).max(axis=1) > 2)
    free = np.flatnonzero(free_rows(trace, 3.0))[::7]

    def distance(signal):
        windows = [own.shape.of(signal, rows) for rows in (struck, free)]
        return median_distance(*windows, np.random.default_rng(0))

    assert 0.5 < distance(own.front.scaled(trace, own.scaling)) / 2.0 < 2  # one trace out of two
    raw = Scaling(own.front.joints)
    plain = raw.rows(estimate.residual, trace.qd, estimate.motion)
    np.testing.assert_array_equal(plain, estimate.residual[:, :4])
    assert distance(plain) > 20  # raw N m, for a kernel of length 3


def test_bad_window():
    with pytest.raises(ValueError, match=r"dt 0\.0 s: expected above 0"):
        WindowShape.at(0.0)
