"""Definiteness and symmetry, as far as rounding lets tell."""

import numpy as np
import pytest
from scipy import sparse

from namlcp.linalg.factors import DENSE_ORDER, has_positive_pivots, is_symmetric


def test_symmetric_but_for_rounding():
    A = np.array([[1.0, 0.3], [0.3 + 1e-15, 2.0]])
    for layout in (np.asarray, sparse.csc_array, sparse.csr_array):
        assert is_symmetric(layout(A))
        assert not is_symmetric(layout(A + np.triu(A, 1) * 1e-12))


@pytest.mark.parametrize("shift", [-1e-3, 1e-3])
@pytest.mark.parametrize("order", [DENSE_ORDER, DENSE_ORDER + 1])
def test_pivots_of_small_and_large_matrices(order, shift):
    """The second differences, shifted by their least eigenvalue: definite or not."""
    side = np.full(order - 1, -1.0)
    least = 2.0 - 2.0 * np.cos(np.pi / (order + 1))
    middle = np.full(order, 2.0 - least + shift)
    triangle = sparse.diags_array([middle, side], offsets=[0, 1], format="csc")
    triangle = sparse.csc_matrix(triangle)
    triangle.sort_indices()  # SciPy 1.15 leaves them as they come
    triangle.indices = triangle.indices.astype(np.int32)
    triangle.indptr = triangle.indptr.astype(np.int32)
    assert has_positive_pivots(triangle) == (shift > 0.0)
