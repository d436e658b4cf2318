"""QPs with bounds alone."""

import numpy as np
import pytest
from scipy.sparse import block_diag, csc_array, diags_array

from namlcp import Status, solve_qp


@pytest.mark.parametrize("off", [0.5, 2.0])
def test_curvature_of_fixed_variables_counts_in_large_problems(off):
    """P is factored in blocks here; the two fixed variables are part of it."""
    n = 3300
    bands = [np.ones(n - 2 - k) for k in (1, 2, 3)]
    offsets = [1, 2, 3, -1, -2, -3]
    large = diags_array([*bands, *bands], offsets=offsets, shape=(n - 2, n - 2))
    large = large + diags_array(np.full(n - 2, 8.0))
    P = csc_array(block_diag((large, np.array([[1.0, off], [off, 1.0]]))))
    q, lb, ub = -np.ones(n), np.zeros(n), np.ones(n)
    ub[-2:] = 0.0
    if off < 1.0:
        result = solve_qp(P, q, lb=lb, ub=ub)
        assert result.status is Status.SOLVED
        assert result.form == "bounds"
    else:
        with pytest.raises(ValueError, match="P must be positive semidefinite"):
            solve_qp(P, q, lb=lb, ub=ub)
