"""Sweep methods with M = A: their matrix is factored once for all iterations.

    modulus:            (A + Omega) (s+ - s) = -2 (A z + q - w)           (Bai 2010)
    nam, modified-nam:  (A + Omega + E - L) (s+ - s) = -2 (A z + q - w)   (the paper)

with A = D - L - U, z = clip(s, l, u), w = Omega (z - s). This is the paper's Method 3.1
with N = 0, written for increments. (The paper has r = 1, here r = 2: only s differs.)
"modulus" is Peaceman-Rachford splitting and converges for every symmetric positive
definite A and every Omega > 0; a symmetric matrix is factored by LDL' or Cholesky. The
matrix of the other two is unsymmetric and factored by LU.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import sparse
from scipy.linalg.lapack import dgetrf, dgetrs, dpotrf, dpotrs
from scipy.sparse.linalg import splu

from namlcp.lcp.data import LCP
from namlcp.lcp.modulus.kernels import S, Z
from namlcp.lcp.modulus.methods import Parameters
from namlcp.lcp.modulus.triangular import Step
from namlcp.linalg import asymmetry, factor_triangle

Solve = Callable[[np.ndarray], np.ndarray]


class FactoredStep(Step):
    """One iteration with the factors of M + Omega, see `factored_step`."""

    def __init__(self, lcp: LCP, omega: np.ndarray, solve: Solve):
        self.lcp, self.omega, self.solve = lcp, omega, solve

    def __call__(self, old: np.ndarray, new: np.ndarray) -> float:
        """Write the next iterate to `new` and return Res(z) of `old`."""
        s, z = old
        w = self.lcp.w(z)
        new[S] = s - 2.0 * self.solve(w - self.omega * (z - s))
        np.clip(new[S], self.lcp.lower, self.lcp.upper, out=new[Z])
        return self.lcp.residual(z, w)


def factored_step(lcp: LCP, given: Parameters) -> FactoredStep | None:
    """Return a step for checked parameters, None if the factorisation fails.

    given.shift is the diagonal of E; None stands for "modulus", without E and L.
    """
    A, omega, shift = lcp.A, given.omega, given.shift
    dense = isinstance(A, np.ndarray)
    if shift is None:
        symmetric = asymmetry(A)[0] == 0.0
        left, diagonal = A, omega
    else:
        symmetric = False
        left = A + (np.tril(A, -1) if dense else sparse.tril(A, -1))
        diagonal = omega + shift
    if dense:
        solve = dense_solver(left + np.diag(diagonal), symmetric)
    else:
        solve = sparse_solver(left + sparse.diags_array(diagonal), symmetric)
    return None if solve is None else FactoredStep(lcp, omega, solve)


def dense_solver(K: np.ndarray, symmetric: bool) -> Solve | None:
    """Factor a dense K; return the function b -> K^-1 b, None if K is singular."""
    if K.size == 0:  # which LAPACK refuses
        return np.copy
    if symmetric:
        L, info = dpotrf(K, lower=1)
        if info == 0:
            return lambda b: dpotrs(L, b, lower=1)[0]
    factors, pivots, info = dgetrf(K)
    if info != 0:
        return None
    return lambda b: dgetrs(factors, pivots, b)[0]


def sparse_solver(K: Any, symmetric: bool) -> Solve | None:
    """Factor a sparse K; return the function b -> K^-1 b, None if K is singular."""
    K = sparse.csc_array(K)
    if symmetric:
        try:
            return factor_triangle(sparse.csc_matrix(sparse.triu(K))).solve
        except ValueError:  # a zero pivot: K is not definite
            pass
    try:
        return splu(K).solve
    except RuntimeError:  # exactly singular
        return None
