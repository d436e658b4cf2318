"""A_FF of an LCP as a linear operator to be inverted, also transposed.

Dense matrices are factored by LAPACK, sparse symmetric ones as the KKT system without
rows, other sparse ones by SuperLU. From order LARGE_LCP on, matrices like those of
differential equations are inverted by a Krylov method with truncated multigrid cycles
instead, with the hierarchy that the solve has made.
"""

from functools import cached_property
from typing import Any, Protocol

import numpy as np
from scipy.linalg.lapack import dgecon, dgetrf, dgetrs
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import lsmr, splu

from namlcp.checks import from_arrays, no_rows
from namlcp.derivatives.face import system_of
from namlcp.derivatives.systems import SINGULAR, ActiveSet
from namlcp.lcp import LARGE_LCP, FreeSystem, Prepared, hierarchy_of
from namlcp.linalg import arrays_of, submatrix
from namlcp.qp import QP

ACCURACY = 1e-12
"""Residual of multigrid solves, relative to the right-hand side."""

INACCURATE = 1e-6
"""Residual for a right-hand side of entries near 1, above which a matrix that was
factored without pivoting is factored anew, with it."""


class FreeMatrix(Protocol):
    """A_FF; `regular` tells whether it has an inverse."""

    regular: bool

    def solve(self, r: np.ndarray, transposed: bool) -> np.ndarray:
        """Return u with A_FF u = r or A_FF' u = r, least squares if A is singular."""


def free_matrix(matrix: Prepared, free: np.ndarray) -> FreeMatrix:
    """Return A_FF ready for solves."""
    if type(matrix.A) is np.ndarray:
        if matrix.symmetric:
            return Symmetric(matrix.A, free)
        return General(matrix.A[np.ix_(free, free)])
    if free.size >= LARGE_LCP and hierarchy_of(matrix) is not None:
        return Multigrid(matrix, free)
    return factored(matrix, free)


def factored(matrix: Prepared, free: np.ndarray) -> FreeMatrix:
    """Return the factors of a sparse A_FF."""
    transpose = from_arrays(arrays_of(matrix.A), matrix.A.shape, csc_array)
    if matrix.symmetric:
        try:
            found = Symmetric(transpose, free)
            if found.is_accurate():
                return found
        except ValueError:  # a pivot vanishes: A is indefinite
            pass
    return SparseGeneral(submatrix(transpose, free, free))


class Symmetric:
    """A symmetric matrix, dense or in CSC: the KKT system of a QP without rows."""

    def __init__(self, A: Any, free: np.ndarray) -> None:
        n = A.shape[0]
        self.A, self.free, nothing = A, free, np.empty(0)
        none = np.empty((0, n)) if type(A) is np.ndarray else no_rows(n)
        side = np.ones(n, dtype=np.int8)
        side[free] = 0
        qp = QP(A, np.zeros(n), none, nothing, none, nothing, nothing, nothing)
        no_places = np.empty(0, dtype=np.int64)
        self.system = system_of(qp, ActiveSet(no_places, no_places, side))
        self.regular = self.system.regular

    def is_accurate(self) -> bool:
        """Tell whether a solve has a small residual; without pivoting it may not."""
        r = np.random.default_rng(0).standard_normal(self.free.size)
        u = np.zeros(self.A.shape[0])
        u[self.free] = self.solve(r, False)
        return bool(np.abs((self.A @ u)[self.free] - r).max(initial=0.0) <= INACCURATE)

    def solve(self, r: np.ndarray, transposed: bool) -> np.ndarray:
        """Return u."""
        right, u = np.zeros((2, self.A.shape[0]))
        nothing = np.empty(0)
        right[self.free] = r
        self.system.solve(right, nothing, nothing, u)
        return u[self.free]


class General:
    """A dense matrix: LU factors and one step of refinement, or its pseudo-inverse."""

    def __init__(self, A: np.ndarray) -> None:
        self.A, self.regular = A, True
        if not A.size:
            return
        size = np.abs(A).sum(axis=0).max()
        self.factors, self.pivots, info = dgetrf(A)
        self.regular = info == 0 and dgecon(self.factors, size)[0] >= SINGULAR
        if not self.regular:
            self.inverse = np.linalg.pinv(A, rcond=SINGULAR * A.shape[0])

    def solve(self, r: np.ndarray, transposed: bool) -> np.ndarray:
        """Return u."""
        if not r.size:
            return r
        if not self.regular:
            return r @ self.inverse if transposed else self.inverse @ r
        u = dgetrs(self.factors, self.pivots, r, trans=int(transposed))[0]
        rest = r - (u @ self.A if transposed else self.A @ u)
        return u + dgetrs(self.factors, self.pivots, rest, trans=int(transposed))[0]


class SparseGeneral:
    """A sparse matrix, given by its transpose: SuperLU and one step of refinement."""

    def __init__(self, transpose: csc_array) -> None:
        self.transpose, self.regular = transpose, True
        try:
            self.factors = splu(transpose)
            pivots = np.abs(self.factors.U.diagonal())
            least, most = pivots.min(initial=1.0), pivots.max(initial=0.0)
            self.regular = bool(least > SINGULAR * most)
        except RuntimeError:  # a pivot is exactly 0
            self.regular = False

    def solve(self, r: np.ndarray, transposed: bool) -> np.ndarray:
        """Return u."""
        M = self.transpose if transposed else self.transpose.T
        if not self.regular:
            return lsmr(M, r, atol=1e-14, btol=1e-14)[0]
        trans = "N" if transposed else "T"
        u = self.factors.solve(r, trans)
        return u + self.factors.solve(r - M @ u, trans)


class Multigrid:
    """A large sparse matrix by truncated cycles, factored where these do not converge.

    A matrix that suits the cycles counts as regular until it is factored.
    """

    regular = True

    def __init__(self, matrix: Prepared, free: np.ndarray) -> None:
        self.matrix, self.free = matrix, free
        self.mask = np.zeros(matrix.A.shape[0], dtype=bool)
        self.mask[free] = True
        self.factors: FreeMatrix | None = None

    @cached_property
    def straight(self) -> FreeSystem | None:
        """The system of A_FF."""
        hierarchy = hierarchy_of(self.matrix)
        return None if hierarchy is None else FreeSystem(hierarchy, self.mask)

    @cached_property
    def turned(self) -> FreeSystem | None:
        """The system of A_FF', None if A' does not suit the cycles."""
        if self.matrix.symmetric:
            return self.straight
        transpose = Prepared.unchecked(csr_array(self.matrix.A.T), False)
        hierarchy = hierarchy_of(transpose)
        return None if hierarchy is None else FreeSystem(hierarchy, self.mask)

    def solve(self, r: np.ndarray, transposed: bool) -> np.ndarray:
        """Return u."""
        system = self.turned if transposed else self.straight
        if system is not None and self.factors is None:
            b = np.zeros(self.mask.size)
            b[self.free] = r
            u, converged = system.solve(b, ACCURACY)
            if converged:
                return u[self.free]
        if self.factors is None:
            self.factors = factored(self.matrix, self.free)
            self.regular = self.factors.regular
        return self.factors.solve(r, transposed)
