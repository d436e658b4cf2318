"""Extreme eigenvalues of D^(-1/2) A D^(-1/2) on the free rows, by a few Lanczos steps.

A nonsymmetric A is replaced by the symmetric matrix C, c_ij = +-sqrt(a_ij a_ji), or 0
if the signs of a_ij and a_ji differ. If A is diagonally similar to a symmetric matrix,
as is every tridiagonal A with a_ij a_ji > 0, C has the eigenvalues of A. A positive
diagonal scaling S A S, S > 0, does not change the estimates.
"""

import math
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eigh_tridiagonal

from namlcp.linalg import is_symmetric

LANCZOS, SHARP = 14, 0.02
"""Limit on Lanczos steps, and the error bound of both extreme Ritz values, relative to
them, at which fewer are taken."""

CERTAIN = 0.5
"""Largest row sum of the scaled |I - A| for which the bounds 1 -+ row sum are used
instead of Ritz values."""

FIRST_LEAST, LEAST = 1e-3, 1e-5
"""Least values of `low`: before the first estimate, and of an estimate."""

SETTLED = 0.3
"""Error bound of the least Ritz value, relative to it, below which another estimate for
the same free rows is not made."""

INVARIANT = 1e-8
"""Norm of the part of a unit vector's image orthogonal to the basis, up to which the
basis spans an invariant subspace: all its eigenvalues are found."""


class Spectrum:
    """Estimates of the extreme eigenvalues of the scaled A on the free rows.

    low, high: the least and the largest one, a and b in `parameters`. above: b of the
    whole matrix, 0 before the first estimate. products: products with A so far.
    """

    def __init__(self, A: Any, D: np.ndarray):
        self.C = symmetric_form(A)
        self.root = np.sqrt(D)
        rows = (abs(self.C) @ (1.0 / self.root)) / self.root - 1.0
        self.row_sum = float(np.max(rows, initial=0.0))
        self.low = max(1.0 - self.row_sum, FIRST_LEAST)
        self.high = 1.0 + self.row_sum
        self.symmetric = self.C is A
        self.above = 0.0
        self.products = 0
        self.free = np.empty(0, dtype=bool)
        self.sharp = False

    def estimate(self, free: np.ndarray, change: np.ndarray) -> None:
        """Update low, high and above for the rows `free` (bool).

        The last `change` of z is rich in the eigenvectors of small eigenvalues.
        """
        if self.row_sum <= CERTAIN or not free.any():
            return
        if self.sharp and np.array_equal(free, self.free):
            return
        if self.above == 0.0:
            everything = np.ones_like(free)
            self.above = self.ritz_values(everything, change, LANCZOS // 2)[1]
        low, high, error = self.ritz_values(free, change, LANCZOS)
        self.low = max(low, 1.0 - self.row_sum, LEAST)
        self.high = min(high, 1.0 + self.row_sum)
        self.free, self.sharp = free, error < SETTLED * low

    def ritz_values(
        self, free: np.ndarray, change: np.ndarray, steps: int
    ) -> tuple[float, float, float]:
        """Return the extreme Ritz values and the error bound of the lower one.

        The start vector is (1, ..., 1), near the lowest eigenvector of an M-matrix,
        plus the change of z, both normalised.
        """
        v = free / math.sqrt(np.count_nonzero(free))
        y = np.where(free, change * self.root, 0.0)
        size = np.linalg.norm(y)
        if 0.0 < size < math.inf:
            v = v + y / (size if v @ y >= 0.0 else -size)
        basis: list[np.ndarray] = []
        diagonal: list[float] = []
        beside = [float(np.linalg.norm(v))]
        values, error = np.ones(1), np.zeros(1)
        while len(basis) < steps and beside[-1] > INVARIANT:
            basis.append(v / beside[-1])
            v = np.where(free, (self.C @ (basis[-1] / self.root)) / self.root, 0.0)
            self.products += 1
            diagonal.append(float(basis[-1] @ v))
            for u in basis:  # full reorthogonalisation
                v = v - (u @ v) * u
            beside.append(float(np.linalg.norm(v)))
            values, vectors = eigh_tridiagonal(diagonal, beside[1:-1])
            error = beside[-1] * np.abs(vectors[-1])
            if (error[[0, -1]] < SHARP * values[[0, -1]]).all():
                break
        return float(values[0]), float(values[-1]), float(error[0])


def symmetric_form(A: Any) -> Any:
    """Return A if it is symmetric, else +-sqrt(a_ij a_ji), 0 where signs differ."""
    if is_symmetric(A):
        return A
    if isinstance(A, np.ndarray):
        root = np.sign(A) * np.sqrt(np.abs(A))
        return np.sign(A) * np.maximum(root * root.T, 0.0)
    root = A.copy()
    root.data = np.sign(A.data) * np.sqrt(np.abs(A.data))
    C = sp.csr_array(root.multiply(root.T.tocsr()))
    C.data = np.maximum(C.data, 0.0)
    return sp.csr_array(C.multiply(A.sign()))
