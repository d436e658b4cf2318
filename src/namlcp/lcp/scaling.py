"""Scalings D A D of a matrix by a positive diagonal D, which keep its class."""

from typing import Any

import numpy as np
from scipy import sparse

EQUILIBRATIONS = 3
"""Rounds of scaling rows and columns by their absolute sums."""


def congruent(A: Any, d: np.ndarray) -> Any:
    """Return D A D, dense or CSC."""
    if sparse.issparse(A):
        D = sparse.diags_array(d)
        return sparse.csc_array(D @ A @ D)
    return A * np.outer(d, d)


def equilibrating_scale(A: Any) -> np.ndarray:
    """Return d > 0: the larger of row sum i and column sum i of |D A D| is near 1."""
    d, size = np.ones(A.shape[0]), abs(A)
    for _ in range(EQUILIBRATIONS):
        total = np.maximum(size @ d, size.T @ d) * d
        d /= np.sqrt(np.where(total > 0.0, total, 1.0))
    return d


def unit_diagonal_scale(A: Any) -> np.ndarray:
    """Return d > 0 such that D A D has a unit diagonal; d_i = 1 where a_ii <= 0."""
    diagonal = A.diagonal()
    return 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
