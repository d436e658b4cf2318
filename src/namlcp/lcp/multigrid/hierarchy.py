"""Ruge and Stueben's hierarchy of a sparse matrix, with a test of what it is worth.

Only negative couplings count as strong, which also serves matrices with some positive
ones. How well the V-cycle contracts is measured; where that disappoints, as on
irregular meshes, the coarsening is repeated with its second pass, and where it still
does the matrix is refused.

Coarsening does not commute with scaling. Matrices of differential equations, jumping
coefficients included, have row sums near zero in the right scaling; between A and
D^-1/2 A D^-1/2 that decides.

References
----------
Ruge and Stueben, in McCormick (ed.), Multigrid Methods, SIAM 1987, 73-130.
"""

import math
from typing import Any

import numpy as np
from scipy import sparse

from namlcp.lcp.multigrid.coarsening import interpolation, unlike_rows
from namlcp.lcp.multigrid.kernels import find_diagonal, residual_vector
from namlcp.lcp.multigrid.vcycle import Level, VCycle
from namlcp.lcp.relaxation import Rows, rows_of
from namlcp.limits import NEVER, Deadline

MAX_COARSE, MAX_DENSE = 50, 500
"""Coarsen down to MAX_COARSE unknowns; more than MAX_DENSE must not be left, since the
last matrix is inverted as a dense one."""

MAX_LEVELS = 30

UNLIKE = 0.03
"""Fraction of the rows whose positive couplings may exceed half the negative ones.

Discretised differential equations have up to 0.02, contact problems from 0.09.
"""

MOST_ENTRIES = 100
"""Entries at most in a row, on average: a matrix with more is nearly dense."""

GROWTH = 6.0
"""Entries of all coarse levels at most, as a multiple of those of A."""

GOOD, USELESS = 0.3, 0.8
"""Of the error a V-cycle may leave: up to GOOD coarsening needs no second pass, beyond
USELESS the hierarchy is refused."""

RATE_CYCLES = 4
"""V-cycles whose last one measures the rate."""

FAR_FROM_ONE = 1e8
"""A largest diagonal entry beyond this, or below its inverse, is scaled."""

EQUAL_SUMS = 1e-12
"""Difference up to which two relative row sums count as equal."""


class Hierarchy:
    """Levels of a matrix, for any number of LCPs with it.

    Made by `build`. It is read only: solves with it may run at the same time.

    Attributes
    ----------
    A : (n, n) csr_array
        The matrix itself.
    symmetric : bool
    scale : (n,) array
        S; the first level is S A S, and A itself where S = I.
    levels : list of Level
    rate : float
        What a V-cycle leaves of the error on A x = 0.
    """

    def __init__(self, A: Any, symmetric: bool, scale: np.ndarray, levels: list[Level]):
        self.A = A
        self.symmetric = symmetric
        self.scale = scale
        self.levels = levels
        self.rate = measured_rate(levels, symmetric)

    @property
    def nbytes(self) -> int:
        """Bytes of all levels, those of A included."""
        parts = (
            (*level.A, *level.P, *level.R, level.diagonal, level.d, level.C)
            for level in self.levels
        )
        return sum(array.nbytes for arrays in parts for array in arrays)


def suits(A: Any) -> bool:
    """Tell at the price of two passes whether a hierarchy of A may be of use.

    A : (n, n) csr_array, canonical. Its diagonal must be positive, its rows short, its
    couplings mostly negative.
    """
    if A.indices.dtype != np.int32 or A.nnz > MOST_ENTRIES * A.shape[0]:
        return False
    count = unlike_rows(rows_of(A), np.empty(A.shape[0]))
    return 0 <= count <= UNLIKE * A.shape[0]


def build(A: Any, symmetric: bool, deadline: Deadline = NEVER) -> Hierarchy | None:
    """Return a hierarchy of A, or None where it is of no use, or late.

    A : (n, n) csr_array, canonical. symmetric : A = A'; nothing tests it here. The
    deadline is looked at before each costly part of a level.
    """
    if not suits(A):
        return None
    scale = scaling(A)
    fine = A
    if not np.all(scale == 1.0):
        S = sparse.diags_array(scale)
        fine = sparse.csr_array(S @ A @ S)
    best = None
    for second_pass in (False, True):
        levels = coarsen(fine, symmetric, second_pass, deadline)
        if deadline.reached():
            return None
        if levels is not None:
            hierarchy = Hierarchy(A, symmetric, scale, levels)
            if best is None or hierarchy.rate < best.rate:
                best = hierarchy
            if best.rate <= GOOD:
                break
    return best if best is not None and best.rate <= USELESS else None


def scaling(A: Any) -> np.ndarray:
    """Return S: 1, or D^-1/2 if the median |row sum| / diagonal of S A S is less.

    Where the diagonal is far from 1, a power of 2 in place of 1: pyamg's weights
    compare products of entries with entries.
    """
    d = A.diagonal()
    if not d.size:
        return d
    ones = np.ones(d.size)
    root = 1.0 / np.sqrt(d)
    plain = np.median(np.abs(A @ ones) / d)
    scaled = np.median(np.abs(A @ root) * root)
    if scaled < plain - EQUAL_SUMS:
        return root
    largest = float(d.max())
    if 1.0 / FAR_FROM_ONE < largest < FAR_FROM_ONE:
        return ones
    return ones * 2.0 ** -round(0.5 * math.log2(largest))


def coarsen(
    A: Any, symmetric: bool, second_pass: bool, deadline: Deadline = NEVER
) -> list[Level] | None:
    """Return the levels of A, None if they grow, end too early or lose a diagonal.

    None, too, once the deadline has come.
    """
    levels: list[Level] = []
    entries = GROWTH * A.nnz
    while entries >= 0 and not deadline.reached():
        n = A.shape[0]
        diagonal, d = np.empty(n, dtype=np.int32), np.empty(n)
        if not find_diagonal(rows_of(A), diagonal, d):
            return None
        found = None
        if n > MAX_COARSE and len(levels) < MAX_LEVELS:
            found = interpolation(A, symmetric, second_pass)
        if found is None:
            if n > MAX_DENSE:
                return None
            last = NO_ROWS, NO_ROWS, NO_INDICES
            levels.append(Level(rows_of(A), diagonal, d, *last))
            return levels
        if deadline.reached():
            return None
        P, C = found
        R = sparse.csr_array(P.T)
        levels.append(Level(rows_of(A), diagonal, d, rows_of(P), rows_of(R), C))
        A = sparse.csr_array(R @ A @ P)
        A.sort_indices()
        entries -= A.nnz
    return None


NO_INDICES = np.empty(0, dtype=np.int32)
NO_ROWS = Rows(np.empty(0), NO_INDICES, NO_INDICES)


def measured_rate(levels: list[Level], symmetric: bool) -> float:
    """Return what the last of a few V-cycles leaves of a random error.

    In the energy norm for symmetric A, else of the residual in the 2-norm.
    """
    A = levels[0].A
    cycle = VCycle(levels, symmetric)
    n = levels[0].d.size
    x = np.random.default_rng(0).standard_normal(n)
    zero, r, y = np.zeros(n), np.empty(n), np.empty(n)
    size, rate = np.inf, 1.0
    for done in range(RATE_CYCLES + 1):
        residual_vector(A, zero, x, r)
        before, size = size, float(r @ x if symmetric else r @ r)
        if not 0.0 < size < np.inf:
            return 0.0 if size == 0.0 else np.inf
        rate = np.sqrt(size / before)
        if done < RATE_CYCLES:
            cycle.solve(0, r, y)
            x -= y
    return float(rate)
