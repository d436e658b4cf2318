"""Definiteness and symmetry, as far as rounding lets tell."""

import numpy as np
from scipy import sparse

from namlcp.linalg import is_positive_semidefinite, is_symmetric


def test_definite_or_not():
    A = np.array([[1.0, 5.0, 0.0], [-5.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    for layout in (np.asarray, sparse.csc_array, sparse.csr_array):
        assert is_positive_semidefinite(layout(A), 1e-10)
        assert not is_positive_semidefinite(layout(A), -1e-10)
        assert not is_positive_semidefinite(layout(A), 0.0)
        assert is_positive_semidefinite(layout(A + np.eye(3)), -1e-10)
        assert not is_positive_semidefinite(layout(A - 1e-3 * np.eye(3)), 1e-10)


def test_symmetric_but_for_rounding():
    A = np.array([[1.0, 0.3], [0.3 + 1e-15, 2.0]])
    for layout in (np.asarray, sparse.csc_array, sparse.csr_array):
        assert is_symmetric(layout(A))
        assert not is_symmetric(layout(A + np.triu(A, 1) * 1e-12))
