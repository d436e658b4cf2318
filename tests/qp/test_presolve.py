"""Rows that look alike, and numbers that are none."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from namlcp.qp.kkt import weighted_norm
from namlcp.qp.transforms.presolve import proportional_rows


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_a_row_with_one_entry_more_is_not_proportional(order):
    """Its key, in single precision, is the same; an entry of 1e-9 is still an entry."""
    M = csr_array(np.array([[1.0, 2.0, 0.0], [2.0, 4.0, 1e-9]])[list(order)])
    assert proportional_rows(M)[0] is None
    M = csr_array(np.array([[1.0, 2.0, 0.0], [2.0, 4.0, 0.0]])[list(order)])
    leader, ratio = proportional_rows(M)
    np.testing.assert_array_equal(leader, 0)
    assert ratio[1] == (2.0 if order[0] == 0 else 0.5)


@pytest.mark.parametrize("place", [0, 1, 2])
def test_the_norm_of_a_residual_with_nan_is_nan(place):
    r, weight = np.array([1.0, -6.0, 2.0]), np.array([1.0, 2.0, 4.0])
    assert weighted_norm(r, weight) == 3.0
    r[place] = np.nan
    assert np.isnan(weighted_norm(r, weight))
