"""Derivatives and the references that they are compared with."""

import numpy as np
import pytest

from validation.derivatives import cases, differences, packages


def test_derivatives_are_those_of_differences_in_more_digits():
    for about in differences.FAMILIES:
        row = differences.row_of(*about, (4, 2))
        assert row["right"] == row["problems"], row
    K = cases.definite(12, np.random.default_rng(0))
    x = np.arange(1.0, 13.0)
    rest = K.astype(np.longdouble) @ differences.extended_solve(K, K @ x) - K @ x
    assert np.abs(rest).max() <= 1e-17 * 1e2


@pytest.mark.parametrize("make", [packages.dense_case, packages.band_case])
def test_our_gradients_are_those_of_the_reference(make):
    data = make(60 if make is packages.band_case else 8)
    solve, backward = packages.nam(data)
    assert packages.error_of(backward(solve()), packages.reference(data)) <= 1e-12
