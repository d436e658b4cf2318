"""One problem for each method, for tests of limits, threads and processes.

``SOLVES[name](**options)`` solves it; LCPs have the names of their `result.method`.
"""

import numpy as np
import problems_lcp as problems
from problems_qp import complementary
from scipy import sparse
from scipy.sparse.linalg import LinearOperator

from namlcp import solve_lcp, solve_qp


def large_dense(n=300, m=900):
    """Return P, q, G, h of a dense QP with some hundred pivots."""
    rng = np.random.default_rng(0)
    B, G = rng.standard_normal((n, n)), rng.standard_normal((m, n))
    return B @ B.T / n + np.eye(n), 10.0 * rng.standard_normal(n), G, 0.1 * np.ones(m)


def sparse_qp():
    """Return a QP for the interior-point method."""
    return complementary(3, 120, 90, 10, 40, 0.02).qp


def lcp(A, q, **fixed):
    return lambda **options: solve_lcp(A, q, **fixed, **options)


def qp(*data):
    return lambda **options: solve_qp(*data, **options)


def operator(A):
    return LinearOperator(A.shape, matvec=lambda x: A @ x, dtype=float)


LAPLACIAN, WAVE = problems.laplacian(10), -np.cos(np.arange(100.0))
BANDS = sparse.diags_array([1.0, 2.5, 1.0], offsets=[-1, 0, 1], shape=(400, 400))
SKEW = problems.skew(np.random.default_rng(0), 40, 1.0)
QPS = {
    "dual": qp(*large_dense(30, 90)),
    "path": qp(*sparse_qp()),
    "bounds": qp(problems.laplacian(10), WAVE, *4 * [None], np.zeros(100)),
    "infeasible": qp(np.eye(3), np.ones(3), [[1] * 3, [-1] * 3], [-1.0, -2.0]),
}
LCPS = {
    "pivoting": lcp(SKEW, np.cos(np.arange(40.0))),
    "tridiagonal": lcp(sparse.csr_array(BANDS), np.cos(np.arange(400.0) ** 2)),
    "mprgp": lcp(operator(problems.laplacian(20)), -np.cos(np.arange(400.0))),
    "multigrid": lcp(
        problems.laplacian(40), np.cos(np.arange(1600.0)) - 0.1,
        method="multigrid", eps_rel=1e-13,
    ),
} | {
    name: lcp(LAPLACIAN, WAVE, method=name, eps_abs=1e-13)
    for name in ("pgs", "psor", "namgs", "modulus", "amsor", "namj")
}  # fmt: skip
SOLVES = QPS | LCPS
