"""Ruge and Stueben's hierarchy of a sparse matrix, and its V-cycles on a face.

If the V(1,1)-cycle contracts too slowly, as on irregular meshes, the coarsening is
repeated with its second pass.

For nonsymmetric A the C/F splitting uses the strong couplings of A and of A': with
those of A alone, cycles on a face of a convective five-point matrix leave 70 % of the
error, not 20 %. pyamg's compiled functions compute splitting and weights; its public
functions copy every matrix.

Coarsening depends on the scaling. Matrices of differential equations, also those with
jumping coefficients, have row sums near zero in the right scaling; by these sums A or
D^-1/2 A D^-1/2 is chosen.

References
----------
Ruge and Stueben, in McCormick (ed.), Multigrid Methods, SIAM 1987, 73-130.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from scipy.linalg.blas import daxpy, dnrm2

from namlcp.arrays import from_arrays
from namlcp.lcp.data import Prepared
from namlcp.lcp.loops import row_sums
from namlcp.lcp.multigrid.kernels import (
    ascend,
    descend,
    free_product,
    strong_couplings,
    truncate_coarse,
)
from namlcp.limits import NEVER, Deadline
from namlcp.linalg.csc import arrays_of

# Coarsening ends at MAX_COARSE unknowns; a matrix with more than MAX_DENSE left on the
# last level, which gets a dense inverse, is refused.
MAX_COARSE, MAX_DENSE, MAX_LEVELS = 50, 500, 30
# Fraction of rows, at most, whose positive couplings exceed half the negative ones:
# discretised differential equations have up to 0.02, contact problems from 0.09.
# Couplings relative to the diagonal that are rounding.
UNLIKE, NO_COUPLING = 0.03, 1e-14
# Entries at most: of a row, on average; of all coarse levels, as a multiple of A's.
MOST_ROW_ENTRIES, MOST_COARSE_ENTRIES = 100, 6.0
# Convergence rate of the V-cycle up to which no second pass is tried, and above which
# the hierarchy is refused. The last one of RATE_CYCLES V-cycles gives the rate.
GOOD, USELESS, RATE_CYCLES = 0.28, 0.7, 3
# A coupling a_ij < 0 is strong if -a_ij >= THETA max_k -a_ik.
THETA = 0.25
# Krylov steps at most between two computations of the residual, and computations of it
# at most: recurrences drift away from it by rounding.
LINEAR_STEPS, RESTARTS = 100, 3
# Vectors kept for each level, for Krylov steps: fresh memory costs more than what is
# done with it, a third of a solve with n = 10^7.
ROOM = 5
# If the largest diagonal entry is not between this and its inverse, A is scaled.
FAR_FROM_ONE = 1e8
# Difference up to which relative row sums count as equal; condition number from which
# on the coarsest matrix gets a pseudo-inverse.
EQUAL_SUMS, SINGULAR_CONDITION = 1e-12, 1e13


class Level(NamedTuple):
    """One level of a hierarchy; P, R and C lead to the next, None on the last.

    A (n, n). diagonal, d: positions and values of its diagonal entries. P (n, m):
    interpolation; R = P'; all csr_arrays. C (m,): the coarse unknowns.
    """

    A: Any
    diagonal: np.ndarray
    d: np.ndarray
    P: Any = None
    R: Any = None
    C: Any = None


class FaceOnLevel(NamedTuple):
    """The free unknowns F of one level, and what follows from them.

    A: the matrix of the level, truncated by the faces of the finer levels. dinv (n,):
    1 / a_ii on F, 0 elsewhere. touched (n,): rows of A that differ from the matrix of
    the level.
    """

    A: Any
    dinv: np.ndarray
    touched: np.ndarray


class VCycle:
    """Approximate inverses of A_FF on the levels of a hierarchy.

    A caller sets a face in faces[k].dinv and calls `follow_face`, which changes coarser
    levels only; so faces on several levels must be set from the coarsest level up.
    all_free: no face will be set, which saves copies of the coarse matrices.
    """

    def __init__(self, levels: list[Level], symmetric: bool, all_free: bool = False):
        self.levels, self.symmetric = levels, symmetric
        self.faces: list[FaceOnLevel] = []
        self.room = []
        for level in levels:  # all unknowns are free
            A, n = level.A, level.d.size
            if self.faces and not all_free:
                parts = A.indptr, A.indices, A.data.copy()
                A = from_arrays(parts, A.shape, sparse.csr_array)
            self.faces.append(FaceOnLevel(A, 1.0 / level.d, np.zeros(n, np.uint8)))
            self.room.append(np.empty((ROOM, n)))
        self.invert_coarsest()

    def follow_face(self, k: int) -> None:
        """Truncate the levels coarser than k after a change of faces[k].dinv."""
        levels, faces = self.levels, self.faces
        for j in range(k, len(levels) - 1):
            truncate_coarse(levels[j], faces[j], levels[j + 1], faces[j + 1])
        self.invert_coarsest()

    def invert_coarsest(self) -> None:
        A, free = self.faces[-1].A, np.flatnonzero(self.faces[-1].dinv)
        self.inverse, block = np.zeros(A.shape), np.ix_(free, free)
        self.inverse[block] = inverse(A.toarray()[block], self.symmetric)

    def solve(self, k: int, b: np.ndarray, x: np.ndarray) -> None:
        """Write the V-cycle from level k on, applied to b, to x."""
        if k == len(self.levels) - 1:
            x[:] = self.inverse @ b
            return
        level, face = self.levels[k], self.faces[k]
        A, P, dinv, diagonal = face.A, level.P, face.dinv, level.diagonal
        residual, correction = self.room[k + 1][:2]
        descend(A, diagonal, P, dinv, b, x, residual)
        self.solve(k + 1, residual, correction)
        ascend(A, diagonal, P, dinv, b, correction, x)

    def krylov(self, k: int, r: np.ndarray, goal: float, steps: int) -> np.ndarray:
        """Solve A_FF x = r, F on level k, to a residual `goal`; return x, 0 outside F.

        x is the cycle's own array, which the next call overwrites, as this one does r.
        Each step makes the residual least along the image of the V-cycle, which is made
        orthogonal to the image before (Orthomin(1): Vinsome, SPE 5729, 1976). On these
        matrices that takes as many V-cycles as conjugate gradients, or as BiCGStab
        where A is not symmetric.
        """
        A, dinv = self.levels[k].A, self.faces[k].dinv
        x, p, Ap, y, Ay = self.room[k]
        x[:] = p[:] = Ap[:] = 0.0
        square = 1.0
        for _ in range(steps):
            if dnrm2(r) <= goal:
                break
            self.solve(k, r, y)
            free_product(A, dinv, y, Ay)
            overlap = float(Ay @ Ap) / square
            p, y = daxpy(p, y, a=-overlap), p
            Ap, Ay = daxpy(Ap, Ay, a=-overlap), Ap
            square = float(Ap @ Ap)
            if not square > 0.0:
                break
            step = float(r @ Ap) / square
            x, r = daxpy(p, x, a=step), daxpy(Ap, r, a=-step)
        return x


def inverse(B: np.ndarray, symmetric: bool) -> Any:
    try:
        X = np.linalg.inv(B)
        if np.linalg.norm(B) * np.linalg.norm(X) < SINGULAR_CONDITION:
            return X
    except np.linalg.LinAlgError:
        pass
    return np.linalg.pinv(B, rcond=1.0 / SINGULAR_CONDITION, hermitian=symmetric)


class Hierarchy(NamedTuple):
    """Levels of A, the first S A S, S = diag(scale); several threads may share them.

    scale: 1.0 where the first is A itself.
    """

    symmetric: bool
    scale: np.ndarray | float
    levels: list[Level]


def solve_free(
    hierarchy: Hierarchy, free: np.ndarray, b: np.ndarray, accuracy: float
) -> tuple[np.ndarray, bool]:
    """Solve A_FF x_F = b_F by Krylov's method with cycles; F (n,) is a mask.

    Returns x (n,), 0 outside F, and whether |b - A x|_F <= accuracy |b|_F in the norm
    of the scaled system of the hierarchy.
    """
    A, scale = hierarchy.levels[0].A, hierarchy.scale
    cycle = VCycle(hierarchy.levels, hierarchy.symmetric)
    cycle.faces[0].dinv[~free] = 0.0
    cycle.follow_face(0)
    b = np.where(free, scale * b, 0.0)
    x, r, goal = np.zeros(b.size), b, accuracy * float(np.linalg.norm(b))
    for _ in range(RESTARTS):
        x += cycle.krylov(0, r.copy(), goal, LINEAR_STEPS)
        r = np.where(free, b - A @ x, 0.0)
    return scale * x, bool(np.linalg.norm(r) <= goal)


def suits(A: Any) -> bool:
    """Tell whether a_ii > 0, rows are short and most couplings are negative."""
    if A.nnz > MOST_ROW_ENTRIES * A.shape[0]:
        return False
    d = A.diagonal()
    if not (d > 0.0).all():
        return False
    x = 1.0 / np.sqrt(d)
    own, others, _ = sums = np.empty((3, d.size))
    row_sums(*arrays_of(A), x, 0.0, 0.0, *sums)
    # the negative couplings and twice the positive ones, scaled to a unit diagonal
    couplings = 1.5 * (A @ x - own) + 0.5 * others
    wrong = np.count_nonzero(couplings > NO_COUPLING * own)
    return bool(wrong <= UNLIKE * d.size)


def hierarchy_of(matrix: Prepared, deadline: Deadline = NEVER) -> Hierarchy | None:
    """Return the levels, which a matrix keeps; None if it does not suit, or if late."""
    if matrix.levels is None:
        levels = build(sparse.csr_array(matrix.A), matrix.symmetric, deadline)
        if levels is not None or not deadline.reached():
            matrix.levels = levels or False
    return matrix.levels or None


def build(A: Any, symmetric: bool, deadline: Deadline) -> Hierarchy | None:
    """Return the levels of a canonical csr_array; None if it does not suit, or late."""
    if not suits(A):
        return None
    scale = scaling(A)
    if not np.all(scale == 1.0):
        S = sparse.diags_array(scale)
        A = sparse.csr_array(S @ A @ S)
    best, least = None, math.inf
    for second_pass in (False, True):
        levels = coarsen(A, symmetric, second_pass, deadline)
        if deadline.reached():
            return None
        rate = math.inf if levels is None else measured_rate(levels, symmetric)
        if rate < least:
            best, least = levels, rate
        if least <= GOOD:
            break
    if best is None or least > USELESS:
        return None
    return Hierarchy(symmetric, scale, best)


def scaling(A: Any) -> np.ndarray | float:
    """Return the diagonal of S, 1.0 or D^-1/2, with less |row sum| / diagonal of S A S.

    The median counts. D^-1/2 if the diagonal is far from 1, as pyamg's weights are not
    scale invariant.
    """
    d = A.diagonal()
    if not d.size:
        return 1.0
    root = 1.0 / np.sqrt(d)
    plain = np.median(np.abs(A.sum(axis=1)) / d)
    scaled = np.median(np.abs(A @ root) * root)
    is_near = 1.0 / FAR_FROM_ONE < float(d.max()) < FAR_FROM_ONE
    return 1.0 if is_near and scaled >= plain - EQUAL_SUMS else root


def coarsen(
    A: Any, symmetric: bool, second_pass: bool, deadline: Deadline
) -> list[Level] | None:
    """Return the levels of A, None after the deadline or where it does not suit."""
    levels: list[Level] = []
    entries = MOST_COARSE_ENTRIES * A.nnz
    while entries >= 0 and not deadline.reached():
        n = A.shape[0]
        rows = np.arange(n, dtype=np.int32).repeat(np.diff(A.indptr))
        diagonal = np.flatnonzero(A.indices == rows).astype(np.int32)
        del rows  # as large as the pattern
        d = A.data[diagonal]
        if d.size < n or not (d > 0.0).all():
            return None
        found = None
        if n > MAX_COARSE and len(levels) < MAX_LEVELS:
            found = interpolation(A, symmetric, second_pass)
        if found is None:
            if n > MAX_DENSE:
                return None
            return [*levels, Level(A, diagonal, d)]
        if deadline.reached():
            return None
        P, C = found
        R = sparse.csr_array(P.T)
        levels.append(Level(A, diagonal, d, P, R, C))
        A = R @ A @ P
        A.eliminate_zeros()
        A.sort_indices()
        entries -= A.nnz
    return None


def measured_rate(levels: list[Level], symmetric: bool) -> float:
    """Return the factor by which the last of a few V-cycles reduces a random error.

    The norm is that of A for symmetric A, else the 2-norm of the residual.
    """
    A, d = levels[0].A, levels[0].d
    cycle = VCycle(levels, symmetric, all_free=True)
    x = np.random.default_rng(0).standard_normal(d.size)
    r, y = np.empty((2, d.size))
    size, rate = np.inf, 1.0
    for done in range(RATE_CYCLES + 1):
        free_product(A, d, x, r)
        before, size = size, float(r @ x if symmetric else r @ r)
        if not 0.0 < size < np.inf:
            return 0.0 if size == 0.0 else np.inf
        rate = np.sqrt(size / before)
        if done < RATE_CYCLES:
            cycle.solve(0, r, y)
            x -= y
    return float(rate)


def interpolation(
    A: Any, symmetric: bool, second_pass: bool
) -> tuple[Any, np.ndarray] | None:
    """Return P (n, m), a sorted csr_array, and the coarse unknowns; None if m = 0 or n.

    second_pass: strongly coupled fine unknowns must have a coarse neighbour in common.
    """
    from pyamg import amg_core  # a slow import

    n = A.shape[0]
    S = strong(A)
    graph = S
    if not symmetric:  # a sum of negative entries, which cannot cancel
        graph = sparse.csr_array(S + strong(sparse.csr_array(A.T)))
        graph.sort_indices()
    pattern = graph.indptr, graph.indices
    marks = np.ones(graph.nnz, dtype=np.int8)
    turned = sparse.csr_array(sparse.csc_array((marks, *pattern[::-1]), shape=(n, n)))
    influence, splitting = np.zeros(n, dtype=np.int32), np.empty(n, dtype=np.int32)
    amg_core.rs_cf_splitting(
        n, *pattern, turned.indptr, turned.indices, influence, splitting
    )
    if second_pass:
        amg_core.rs_cf_splitting_pass2(n, *pattern, splitting)
    coarse = np.flatnonzero(splitting).astype(np.int32)
    if not 0 < coarse.size < n:
        return None
    amg_core.remove_strong_FF_connections(n, S.indptr, S.indices, S.data, splitting)
    S.eliminate_zeros()
    indptr = np.empty(n + 1, dtype=np.int32)
    amg_core.rs_classical_interpolation_pass1(n, S.indptr, S.indices, splitting, indptr)
    indices, data = np.empty(indptr[-1], dtype=np.int32), np.empty(indptr[-1])
    both = *arrays_of(A), *arrays_of(S)
    amg_core.rs_classical_interpolation_pass2(
        n, *both, splitting, indptr, indices, data, True
    )
    P = sparse.csr_array((data, indices, indptr), shape=(n, coarse.size))
    P.sort_indices()
    return P, coarse


def strong(A: Any) -> Any:
    """Return the strong couplings of A, with their values, as a csr_array."""
    indptr, indices, data = [np.empty_like(part) for part in arrays_of(A)]
    count = strong_couplings(A, THETA, indptr, indices, data)
    parts = indptr, indices[:count], data[:count]
    return from_arrays(parts, A.shape, sparse.csr_array)
