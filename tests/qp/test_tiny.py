"""Tiny QPs that are sparse or stored by columns, which go where small dense ones go."""

import numpy as np
import pytest
import scipy.sparse as sp
from problems_qp import complementary, dense
from qpsolvers import Problem, Solution

from namlcp import Status, solve_qp


@pytest.mark.parametrize("kind", [sp.csc_matrix, np.asfortranarray])
@pytest.mark.parametrize("size", [1.0, 1e4, 1e7, 1e9])
def test_large_terms_are_judged_in_the_order_of_the_arguments(size, kind):
    """What qpsolvers computes itself, whatever is said of the status."""
    P, q, G, h, A, b, lb, ub = dense(complementary(7, 10, 8, 3, 6).qp)
    P, G, A = map(kind, (P, G, A))
    far = size * np.ones(10)
    given = (P, q - P @ far, G, h + G @ far, A, b + A @ far, lb + far, ub + far)
    result = solve_qp(*given, eps_abs=1e-9, eps_rel=0.0)
    host = Solution(Problem(*given), found=True)
    host.x, host.y, host.z, host.z_box = result.x, result.y, result.z, result.z_box
    theirs = host.primal_residual(), host.dual_residual(), host.duality_gap()
    if result.status is Status.SOLVED:
        assert max(theirs) <= 1e-9
    else:
        assert size >= 1e7


@pytest.mark.parametrize("fault", ["row", "column", "end"])
def test_a_corrupt_matrix_is_named(fault):
    G = sp.csc_array(np.ones((3, 2)))
    if fault == "row":
        G.indices[0] = 7
    elif fault == "column":
        G.indptr[1] = -1
    else:
        G.indptr[2] = 99
    with pytest.raises(ValueError, match="G must have indices within its shape"):
        solve_qp(sp.eye_array(2, format="csc"), np.ones(2), G, np.ones(3))


def test_a_result_of_matrices_by_columns_has_derivatives_until_they_change():
    P, q, G, h, A, b, lb, ub = dense(complementary(3, 6, 5, 2, 6).qp)
    P, G, A = map(np.asfortranarray, (P, G, A))
    result = solve_qp(P, q, G, h, A, b, lb, ub, derivative=True)
    other = solve_qp(*map(np.ascontiguousarray, (P, q, G, h, A, b, lb, ub)))
    np.testing.assert_array_equal(result.x, other.x)
    ones = np.ones(6)
    np.testing.assert_allclose(
        result.backward(ones).P, other.backward(ones).P, 0.0, 1e-12
    )
    G[0, 1] += 1.0
    with pytest.raises(ValueError, match="changed"):
        result.derivative  # noqa: B018


@pytest.mark.parametrize("of_G", [np.array, np.asfortranarray, sp.csc_array])
@pytest.mark.parametrize("of_A", [np.array, sp.csc_array])
def test_a_sparse_cost_beside_dense_rows_has_derivatives(of_G, of_A):
    P, q, ones = np.array([[2.0, 0.5], [0.5, 1.0]]), np.array([-1.0, -2.0]), np.ones(2)
    G, h, A, b = np.ones((1, 2)), np.ones(1), np.array([[1.0, -1.0]]), np.full(1, 0.1)
    expected = solve_qp(P, q, G, h, A, b).backward(ones, dz=[1.0])
    found = solve_qp(sp.csc_array(P), q, of_G(G), h, of_A(A), b).backward(
        ones, dz=[1.0]
    )
    np.testing.assert_allclose(found.q, expected.q, 0.0, 1e-12)
    for name, kind in (("G", of_G), ("A", of_A)):
        gradient, full = getattr(found, name), getattr(expected, name)
        assert sp.issparse(gradient) == (kind is sp.csc_array)
        gradient = gradient.toarray() if sp.issparse(gradient) else gradient
        np.testing.assert_allclose(gradient, full, 0.0, 1e-12)
