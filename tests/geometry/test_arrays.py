"""What a native kernel is given is an array of finite numbers, or the argument is named."""

import numpy as np
import pytest

from tauguard.geometry.arrays import finite


@pytest.mark.parametrize(
    "value",
    [
        ["1", "2"],
        [1 + 1j, 2],
        np.array([1, 2], dtype="datetime64[s]"),
        [b"1", b"2"],
        [10**400, 1],
        [[1], [1, 2]],
        [{}, 1],
    ],
)
def test_what_is_no_number_is_refused(value):
    with pytest.raises(ValueError, match="x: not an array of numbers"):
        finite("x", value, (2,))


@pytest.mark.parametrize(
    "value",
    [[1, 2], (1.0, 2), np.array([1, 2], np.int8), np.array([1, 2], np.float16), [1, 10**20]],
)
def test_any_numbers_become_contiguous_doubles(value):
    array = finite("x", value, (2,))
    assert array.dtype == np.float64
    assert array.flags.c_contiguous
    assert array.tolist() == [float(v) for v in value]


def test_an_array_that_fits_is_not_copied():
    given = np.ones((3, 2))
    assert np.shares_memory(finite("x", given, (None, 2)), given)


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ([[1.0, 2.0], [np.nan, 0.0]], "x: nan in row 1; every entry must be finite"),
        ([[1.0, -np.inf]], "x: -inf in row 0"),
        ([1.0, 2.0], r"x: shape \(2,\), expected \(N, 2\)"),
        ([[1.0]], r"x: shape \(1, 1\), expected \(N, 2\)"),
    ],
)
def test_the_first_bad_row_and_the_shape_are_named(value, said):
    with pytest.raises(ValueError, match=said):
        finite("x", value, (None, 2))


def test_a_number_that_was_not_finite_when_it_was_looked_at_is_refused(monkeypatch):
    """Another thread may mend the array between two looks; there must be only one."""
    array, isfinite = np.array([1.0, np.nan]), np.isfinite

    def mended_after(values):
        known = isfinite(values)
        array[:] = 1.0
        return known

    monkeypatch.setattr(np, "isfinite", mended_after)
    with pytest.raises(ValueError, match=r"x: .* in index 1; every entry must be finite"):
        finite("x", array, (2,))
