"""Factors with refined solves; those of singular matrices are of least squares.

The KKT matrix K is scaled to rows of size 1 and factored as the quasi-definite K +
DELTA diag(I, -I): each step of refinement multiplies the error by about DELTA over the
least singular value of K.
"""

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
from scipy.linalg.lapack import dgetrf, dgetrs
from scipy.sparse import csc_array
from scipy.sparse.linalg import lsmr, splu

from namlcp.arrays import from_arrays
from namlcp.checks import no_rows
from namlcp.linalg.csc import add_transposed, by_rows, times
from namlcp.qp.kkt import KKT, equilibrate

# A matrix is singular if the ratio of its pivots is below this; singular values below
# this times its order count as 0.
SINGULAR = 1e-13
# Most steps of refinement, and the residual that ends it, relative to the largest
# number of right-hand side and solution.
REFINEMENTS, ROUNDING = 20, 1e-15
# DELTA. A smaller shift makes smaller pivots, whose rounding errors would exceed it;
# the larger ones are tried where a pivot is 0 by rounding.
SHIFTS = 1e-8, 3.7e-8, 1.3e-7
# Steps that project random vectors to the null space of K; how many vectors, until the
# null space has fewer dimensions (of one with more than the last a part is found).
PROJECTIONS, WIDTHS = 4, (1, 4, 16, 64)
# A projected unit vector with a norm below VANISHED over sqrt(order) counts as 0: a
# random one has a larger part in any null space. Those with singular values below NULL,
# relative to the largest, are multiples of the others; of a unit vector v of the null
# space || K v || is at most ZERO_IMAGE, for K scaled.
VANISHED, NULL, ZERO_IMAGE = 1e-3, 1e-6, 1e-12


def refined(
    solve: Callable[[np.ndarray], Any],
    product: Callable[[np.ndarray], np.ndarray],
    r: np.ndarray,
) -> np.ndarray:
    """Solve K w = r: by what solves it up to errors, and by products with K."""
    w, rest, error = np.zeros(r.size), r, np.inf
    for _ in range(REFINEMENTS):
        trial = w + solve(rest)
        rest = r - product(trial)
        before, error = error, float(np.abs(rest).max(initial=0.0))
        if not error < before:
            break
        w = trial
        size = max(np.abs(v).max(initial=0.0) for v in (r, w))
        if not ROUNDING * size < error < 0.5 * before:
            break
    return w


class LUFactors:
    """LU factors of K with rows and columns scaled; least squares if it is singular."""

    def __init__(self, K: Any) -> None:
        size = abs(K)
        self.rows, self.columns = scales = [size.sum(axis=k) for k in (1, 0)]
        for scale in scales:
            scale[scale == 0.0] = 1.0
            scale **= -0.5
        K, pivots = self.rows[:, None] * K * self.columns, np.zeros(1)
        if isinstance(K, np.ndarray):
            lu, order, _ = dgetrf(K)
            pivots = np.abs(lu.diagonal())
            self.solve_scaled = lambda v, turned: dgetrs(lu, order, v, turned)[0]
        else:
            K = csc_array(K)
            with suppress(RuntimeError):  # a pivot is exactly 0
                lu = splu(K)
                pivots = np.abs(lu.U.diagonal())
                self.solve_scaled = lambda v, turned: lu.solve(v, "NT"[turned])
        self.K, self.regular = K, bool(pivots.min() > SINGULAR * pivots.max())

    def solve(self, r: np.ndarray, transposed: bool = False) -> np.ndarray:
        K, left, right = self.K, self.rows, self.columns
        if transposed:
            K, left, right = K.T, right, left
        if self.regular:
            w = refined(
                lambda v: self.solve_scaled(v, transposed), K.__matmul__, left * r
            )
        elif isinstance(K, np.ndarray):
            w = np.linalg.lstsq(K, left * r, SINGULAR * r.size)[0]
        else:
            w = lsmr(K, left * r, atol=1e-14, btol=1e-14)[0]
        return right * w


class KKTFactors:
    """L D L' of the sparse matrix K of P and C; all in CSC.

    null_space (order, k): a basis of the vectors that K maps to 0.
    """

    def __init__(self, P: Any, C: Any) -> None:
        self.kkt = kkt = KKT(P, by_rows(C), by_rows(no_rows(C.shape[1])))
        self.scale = np.ones(kkt.size)
        values = kkt.base.copy()
        equilibrate(kkt.indptr, kkt.indices, values, self.scale)
        self.diagonal, shape = values[kkt.diagonal], (kkt.size, kkt.size)
        self.triangle = from_arrays((kkt.indptr, kkt.indices, values), shape)
        for shift in SHIFTS:
            kkt.data[:] = values
            kkt.data[kkt.diagonal[: kkt.n]] += shift
            kkt.data[kkt.diagonal[kkt.n :]] -= shift
            if kkt.factor():
                break
        else:
            raise ValueError("the KKT matrix of the active constraints has no factors")
        self.basis = self.find_null_space()
        self.null_space = (self.basis * self.scale).T
        self.regular = not self.null_space.size

    def find_null_space(self) -> np.ndarray:
        """Return an orthonormal basis of the null space of K scaled, by rows.

        v - K~^-1 K v, K~ the factored matrix, keeps what K maps to 0 and multiplies all
        else by about DELTA over its singular value.
        """
        size, V = self.kkt.size, np.empty((0, 0))
        for width in WIDTHS if size else ():
            V = np.random.default_rng(0).standard_normal((min(width, size), size))
            V /= np.linalg.norm(V, axis=1)[:, None]
            for _ in range(PROJECTIONS):
                V = np.array([v - self.kkt.plan().solve(self.product(v)) for v in V])
                if np.linalg.norm(V, axis=1).max() < VANISHED / np.sqrt(size):
                    return V[:0]
            values, V = np.linalg.svd(V, full_matrices=False)[1:]
            image = np.array([np.linalg.norm(self.product(v)) for v in V])
            V = V[(values > NULL * values[0]) & (image <= ZERO_IMAGE)]
            if V.shape[0] < width:
                break
        return V

    def product(self, w: np.ndarray) -> np.ndarray:
        Kw = times(self.triangle, w) - self.diagonal * w
        add_transposed(self.triangle, w, Kw)
        return Kw

    def solve(self, r: np.ndarray, transposed: bool = False) -> np.ndarray:
        """Return the solution, of least norm for the scaled K if it is singular."""
        r, N = r * self.scale, self.basis
        w = refined(self.kkt.plan().solve, self.product, r - N.T @ (N @ r))
        return (w - N.T @ (N @ w)) * self.scale
