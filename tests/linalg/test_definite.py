"""Definiteness and symmetry, as far as rounding lets tell."""

import numpy as np
import pytest
from scipy import sparse

from namlcp.linalg import (
    has_positive_pivots,
    is_positive_semidefinite,
    is_symmetric,
)
from namlcp.linalg.definite import DENSE_ORDER


def test_definite_or_not():
    A = np.array([[1.0, 5.0, 0.0], [-5.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    for layout in (np.asarray, sparse.csc_array, sparse.csr_array):
        assert is_positive_semidefinite(layout(A), 1e-10)
        assert not is_positive_semidefinite(layout(A), -1e-10)
        assert not is_positive_semidefinite(layout(A), 0.0)
        assert is_positive_semidefinite(layout(A + np.eye(3)), -1e-10)
        assert not is_positive_semidefinite(layout(A - 1e-3 * np.eye(3)), 1e-10)


def test_a_diagonal_that_the_tolerance_cancels_is_not_definite():
    A = sparse.csc_array(np.array([[2.0, 1.0], [1.0, -1.0]]))
    assert not is_positive_semidefinite(A, 1.0)
    assert not is_positive_semidefinite(sparse.csc_array((3, 3)), 0.0)


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
    triangle.indices = triangle.indices.astype(np.int32)
    triangle.indptr = triangle.indptr.astype(np.int32)
    assert has_positive_pivots(triangle) == (shift > 0.0)


@pytest.mark.parametrize("j", [0, 5, DENSE_ORDER])
def test_a_diagonal_entry_that_is_not_stored_is_0(j):
    order = DENSE_ORDER + 1
    ones = np.ones(order)
    triangle = sparse.csc_array(np.diag(ones) + 0.1 * np.diag(ones[1:], 1))
    assert has_positive_pivots(triangle)
    triangle[j, j] = 0.0
    triangle.eliminate_zeros()
    assert not has_positive_pivots(triangle)
