"""Methods with M = A: the left-hand matrix is factored once and serves every iteration.

    modulus:            (A + Omega) (s+ - s) = -2 (A z + q - w)           (Bai 2010)
    nam, modified-nam:  (A + Omega + E - L) (s+ - s) = -2 (A z + q - w)   (the paper)

with A = D - L - U, z = clip(s, l, u), w = Omega (z - s): the increment form of the
paper's Method 3.1 with N = 0 (r only scales s: r = 2 here, r = 1 there, the same z).
"modulus" is Peaceman-Rachford splitting and converges for every symmetric positive
definite A and every Omega > 0; its matrix is symmetric if A is: LDL' or Cholesky. The
other two have an unsymmetric matrix, LU.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import qdldl
from scipy import sparse
from scipy.linalg.lapack import dgetrf, dgetrs, dpotrf, dpotrs
from scipy.sparse.linalg import splu

from namlcp.linalg import asymmetry
from namlcp.residuals import natural_residual

Solve = Callable[[np.ndarray], np.ndarray]


def factored_step(
    A: Any,
    q: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    omega: np.ndarray,
    shift: np.ndarray | None,
) -> Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], float] | None:
    """Return one iteration as a function step(s, z, s_next, z_next) -> Res(z).

    `shift` is the diagonal of E; None stands for "modulus", without E and L. None is
    returned where the matrix has no factorisation.
    """
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
    if solve is None:
        return None

    def step(
        s: np.ndarray, z: np.ndarray, s_next: np.ndarray, z_next: np.ndarray
    ) -> float:
        w = A @ z + q
        s_next[:] = s - 2.0 * solve(w - omega * (z - s))
        np.clip(s_next, lower, upper, out=z_next)
        return natural_residual(z, w, lower, upper)

    return step


def dense_solver(K: np.ndarray, symmetric: bool) -> Solve | None:
    """Factor K (n, n); return x = K^-1 b as a function of b."""
    if symmetric:
        L, info = dpotrf(K, lower=1)
        if info == 0:
            return lambda b: dpotrs(L, b, lower=1)[0]
    factors, pivots, info = dgetrf(K)
    if info != 0:
        return None
    return lambda b: dgetrs(factors, pivots, b)[0]


def sparse_solver(K: Any, symmetric: bool) -> Solve | None:
    """Factor the sparse matrix K; return x = K^-1 b as a function of b."""
    K = sparse.csc_array(K)
    if symmetric:
        try:
            return qdldl.Solver(sparse.csc_matrix(sparse.triu(K)), upper=True).solve
        except RuntimeError:  # a zero pivot: K is not definite
            pass
    try:
        return splu(K).solve
    except RuntimeError:  # exactly singular
        return None
