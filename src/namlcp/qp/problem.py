"""A QP as clean arrays, its points and guesses, and the checks of arguments."""

import functools
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg.lapack import dpotrf

from namlcp.checks import (
    INFINITE,
    LEAST_DIVISOR,
    as_sparse,
    constant,
    finite_square_matrix,
    from_arrays,
    matrix,
    number_or_vector,
    refuse_number,
    sparse_matrix,
    vector,
    without_huge,
)
from namlcp.limits import NEVER, Deadline
from namlcp.linalg.csc import as_dense, unit_triangle
from namlcp.linalg.factors import PSD_SLACK, asymmetry, has_positive_pivots
from namlcp.theory.comparison import is_h_plus


class Point(NamedTuple):
    """A point x of a QP with the multipliers of Ax = b, Gx <= h and the bounds.

    A certificate has the same parts: (NaN, y, z, z_box) proves that no x is feasible,
    (d, NaN, NaN, NaN) that the QP is unbounded along d.
    """

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    z_box: np.ndarray


# Largest |P - P'| that counts as rounding, relative to max |P|, or entry by entry to
# sqrt(|P_ii P_jj|): of single precision.
ASYMMETRY, SINGLE_ASYMMETRY = 1e-10, 1e-6
# A row g'x <= h switched off by h >= INFINITE must allow |x_j| up to this.
STEEP = 1e10


class QP(NamedTuple):
    """A checked QP with three dense matrices, or three of class csc_array.

    Absent parts have zero rows, absent bounds are infinite.
    """

    P: Any
    q: np.ndarray
    G: Any
    h: np.ndarray
    A: Any
    b: np.ndarray
    lb: np.ndarray
    ub: np.ndarray

    @property
    def is_dense(self) -> bool:
        return type(self.P) is np.ndarray

    def in_dense_form(self) -> "QP":
        if self.is_dense:
            return self
        P, G, A = map(as_dense, (self.P, self.G, self.A))
        return self._replace(P=P, G=G, A=A)

    def point(self, x: np.ndarray | None = None) -> Point:
        """Return x, or 0, with multipliers that are 0."""
        n = self.q.size
        x = np.zeros(n) if x is None else x
        return Point(x, np.zeros(self.b.size), np.zeros(self.h.size), np.zeros(n))

    def clip(self, x: np.ndarray) -> np.ndarray:
        return np.minimum(np.maximum(x, self.lb), self.ub)

    def joined(self) -> np.ndarray:
        """Return q, h, b, lb and ub, one after another."""
        return np.concatenate((self.q, self.h, self.b, self.lb, self.ub))

    @classmethod
    def of(cls, matrices: tuple[Any, Any, Any], joined: np.ndarray) -> "QP":
        """Return the QP of P, G, A and vectors as `joined` returns them, not copied."""
        P, G, A = matrices
        h = P.shape[0]
        b = h + G.shape[0]
        lb = b + A.shape[0]
        ub = lb + h
        q, sides = joined[:h], (joined[lb:ub], joined[ub:])
        return cls(P, q, G, joined[h:b], A, joined[b:lb], *sides)

    def has_matrices_of(self, other: "QP") -> bool:
        return self.P is other.P and self.G is other.G and self.A is other.A


def refuse_steep_rows(G: Any, h: np.ndarray) -> None:
    """Raise ValueError where a row is switched off by h_i < STEEP max_j |G_ij|."""
    off = np.flatnonzero((h >= INFINITE) & (h < np.inf))
    if off.size == 0:
        return
    rows = sp.csr_array(G)[off]
    sizes = np.zeros(off.size) if rows.nnz == 0 else abs(rows).max(axis=1).toarray()
    steep = np.flatnonzero(h[off] / STEEP < sizes)
    if steep.size > 0:
        i, size = off[steep[0]], sizes[steep[0]]
        raise ValueError(
            f"h must be +inf where there is no constraint, got {h[i]:.1e} at ({i}), "
            f"where G has entries of {size:.1e}: divide this row and h by that"
        )


def symmetrised(P: Any, gap: float, size: float) -> Any:
    """Return (P + P') / 2; raise if gap, max |P - P'|, exceeds rounding of max |P|."""
    if gap > ASYMMETRY * size:
        off, root = as_sparse(0.5 * P - 0.5 * P.T).tocoo(), np.sqrt(abs(P.diagonal()))
        scale = root[off.row] * root[off.col]
        if not (np.abs(off.data) <= 0.5 * SINGLE_ASYMMETRY * scale).all():
            raise ValueError(
                f"P must be symmetric: max |P - P'| = {gap:.1e}; "
                "pass (P + P.T) / 2 if that is intended"
            )
    S = 0.5 * P + 0.5 * P.T
    return sparse_matrix("P", S, "csc") if sp.issparse(P) else S


def refuse_half(name: str, C: Any, right: str, d: Any) -> None:
    if (C is None) != (d is None):
        given, missing = (name, right) if d is None else (right, name)
        raise ValueError(f"{given} was given without {missing}: pass both or neither")


def constraint(name: str, C: Any, right: str, d: Any, n: int) -> Any:
    """Return the pair (G, h) or (A, b); raise if one of them alone is None."""
    if C is None and d is None:
        return absent_parts(n)[:2]
    refuse_half(name, C, right, d)
    C = matrix(name, C, "csc")
    if C.shape[1] != n:
        raise ValueError(
            f"{name} must have {n} columns to match q of shape ({n},), got {C.shape}"
        )
    return C, vector(right, d, C.shape[0], name, C.shape)


@functools.lru_cache(maxsize=64)
def absent_parts(n: int) -> tuple[np.ndarray, ...]:
    """Return the absent G, h, lb and ub of all QPs with n variables: read only."""
    return np.empty((0, n)), np.empty(0), constant(n, -np.inf), constant(n, np.inf)


def qp_arrays(P: Any, q: Any, G: Any, h: Any, A: Any, b: Any, lb: Any, ub: Any) -> QP:
    """Return the user's QP as arrays of the right types and shapes; else raise."""
    P = finite_square_matrix("P", P, "csc")
    n = P.shape[1]
    q = vector("q", q, n, "P", P.shape)
    G, h = constraint("G", G, "h", h, n)
    A, b = constraint("A", A, "b", b, n)
    *_, below, above = absent_parts(n)
    lb = below if lb is None else number_or_vector("lb", lb, n, "P")
    ub = above if ub is None else number_or_vector("ub", ub, n, "P")
    if not type(P) is type(G) is type(A) is np.ndarray:
        P, G, A = (as_sparse(C) for C in (P, G, A))
    return QP(P, q, G, h, A, b, lb, ub)


def repaired(qp: QP) -> QP:
    """Return the QP of `qp_arrays` with P symmetric and no huge sides; else raise.

    Contradictions (lb > ub, h = -inf) pass: such a QP is infeasible, not malformed.
    """
    for name, values in zip(qp._fields, qp, strict=True):
        refuse_number(name, values, name in ("h", "lb", "ub"))
    gap, size = asymmetry(qp.P)
    P = symmetrised(qp.P, gap, size) if gap > 0.0 else qp.P
    refuse_steep_rows(qp.G, qp.h)
    h, lb, ub = map(without_huge, (qp.h, qp.lb, qp.ub), (1.0, -1.0, 1.0))
    return qp._replace(P=P, h=h, lb=lb, ub=ub)


# ---- convexity

# Least order of P for which `is_h_plus`, a multigrid method, is tried before a
# factorisation, which may cost far more.
MULTIGRID_ORDER = 50_000
# Entry p_jj, relative to max |P|, up to which it counts as 0; row j must be 0 then.
ZERO = 1e-15


class NotConvex(ValueError):
    """P is not positive semidefinite: the QP is not convex.

    Examples
    --------
    >>> import namlcp
    >>> try:
    ...     namlcp.solve_qp(-np.eye(1), np.zeros(1))
    ... except namlcp.NotConvex as error:
    ...     print(error)
    P must be positive semidefinite: its diagonal entry 0 is negative
    """


def check_convex(P: Any, deadline: Deadline = NEVER) -> None:
    """Raise NotConvex unless P, symmetric, dense or CSC, is positive semidefinite.

    Constraints can hide negative curvature in the KKT matrix, and a stationary point of
    a non-convex problem passes every residual check. The last test is the pivots of P,
    scaled to a unit diagonal, plus `PSD_SLACK` I. OutOfTime if the deadline is reached.
    """
    if type(P) is np.ndarray:
        if dpotrf(P)[1] == 0:
            return  # definite, as most are: this takes a tenth of the time
        P = as_sparse(P)
    sign, i, j, parts = unit_triangle(P, ZERO, LEAST_DIVISOR, PSD_SLACK)
    if sign > 0:
        return
    if sign == 0:
        if P.shape[0] >= MULTIGRID_ORDER and is_h_plus(P.T):
            return
        order = parts[0].size - 1
        if has_positive_pivots(from_arrays(parts, (order, order)), deadline):
            return
        reason = (
            f"an eigenvalue of P with its diagonal scaled to 1 is below -{PSD_SLACK:g}"
        )
    elif i == j:
        reason = f"its diagonal entry {j} is negative"
    else:
        reason = (
            f"the determinant of its rows and columns {i} and {j} is negative, and so "
            "is an eigenvalue"
        )
    raise NotConvex(f"P must be positive semidefinite: {reason}")


# ---- starting points: a guess of x, or the solution of a similar problem

# Largest |slack| of an inequality that counts as active at a guess of x, relative to
# 1 + |right-hand side|: the accuracy of a solution in single precision.
ACTIVE = 1e-7


class Guess(NamedTuple):
    """A guess of the solution; all arrays are empty where there is none.

    active (m + 2 n,) int8 is 1 for active rows of G, lower bounds and upper bounds.
    """

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    z_box: np.ndarray
    active: np.ndarray


NO_ENTRIES = np.empty(0)
NO_GUESS = Guess(*Point(*[NO_ENTRIES] * 4), np.empty(0, np.int8))


def make_guess(qp: QP, x0: Any, warm_start: Any, name: str = "x0") -> Guess:
    """Return the guess that warm_start makes, or else x0, called `name` in errors."""
    if warm_start is None:
        if x0 is None:
            return NO_GUESS
        x = vector(name, x0, qp.q.size, "q", qp.q.shape, finite=True)
        slack = np.concatenate((qp.h - qp.G @ x, x - qp.lb, qp.ub - x))
        size = 1.0 + np.abs(np.concatenate((qp.h, qp.lb, qp.ub)))
        active = np.isfinite(size) & (np.abs(slack) <= ACTIVE * size)
        return Guess(*qp.point(x), active.astype(np.int8))
    if not all(hasattr(warm_start, key) for key in Point._fields):
        raise TypeError(
            "warm_start must be a QPResult or a qpsolvers.Solution, with x, y, z and "
            f"z_box, got {warm_start!r:.60}"
        )
    parts: list[Any] = [getattr(warm_start, key) for key in Point._fields]
    if any(part is None for part in parts):  # a Solution without a point
        return NO_GUESS
    if not np.size(parts[3]):  # no bounds
        parts[3] = np.zeros(qp.q.size)
    for k, other in enumerate(("q", "b", "h", "q")):
        own, name = getattr(qp, other), f"warm_start.{Point._fields[k]}"
        parts[k] = vector(name, parts[k], own.size, other, own.shape)
    _, _, z, z_box = point = Point(*parts)
    if not np.isfinite(np.concatenate(point)).all():  # a certificate, not a point
        return NO_GUESS
    active = np.concatenate((z > 0.0, z_box < 0.0, z_box > 0.0))
    active &= np.isfinite(np.concatenate((qp.h, qp.lb, qp.ub)))
    return Guess(*point, active.astype(np.int8))
