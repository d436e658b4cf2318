"""Two QPs, always solvable, that decide whether a QP is infeasible or unbounded.

    elastic:    min |s|^2/2 + |t|^2/2,  Gu - s <= (h - G x0)/k,
                Au - t = (b - A x0)/k,  (lb - x0)/k <= u <= (ub - x0)/k
    recession:  min |d|^2/2 + q'd,  P d = 0,  A d = 0,  G d <= 0,
                d <= 0 (d >= 0) where an upper (lower) bound is finite

x0 is within the bounds, k the largest violation there; rows are scaled to unit norm.
The row multipliers of the first are a Farkas certificate if the constraints are
infeasible. The second projects -q on the directions of recession: d != 0 is a ray.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse import csc_array

from namlcp.checks import sparse_matrix
from namlcp.linalg import LEAST_DIVISOR
from namlcp.qp.certificates import accept_dual, accept_primal, largest
from namlcp.qp.problem import QP, Point
from namlcp.status import Status

# Violation over max(1, |A x|, |G x|) up to which a ray is looked for first.
NEARLY_FEASIBLE = 1e-6
# The elastic QP is solved only if the violation is above this times the tolerance.
SATISFIED = 1e-4

Solver = Callable[[QP], Point]
Projection = Callable[[np.ndarray, np.ndarray, np.ndarray], Point | None]


def find_certificate(
    qp: QP, point: Point, tol: float, solver: Solver, project: Projection | None = None
) -> tuple[Status, Point] | None:
    """Return a verdict with its proof, or None, starting from `point`.

    A ray is looked for first where the point nearly satisfies the rows. `project` makes
    a proof of (x, y, z) if the solution of the elastic QP is not accurate enough.
    """
    x, y, z, _ = point
    x = np.minimum(np.maximum(x, qp.lb), qp.ub)
    Ax, Gx = qp.A @ x, qp.G @ x
    violation = max(largest(Ax - qp.b), (Gx - qp.h).max(initial=0.0))
    nearly = max(tol, NEARLY_FEASIBLE * max(1.0, largest(Ax), largest(Gx)))
    verdicts = Status.PRIMAL_INFEASIBLE, Status.DUAL_INFEASIBLE
    for status in verdicts if violation > nearly else verdicts[::-1]:
        if status is Status.PRIMAL_INFEASIBLE:
            y_found, z_found = elastic(qp, solver, x, SATISFIED * tol)
            proof = accept_primal(qp, x, y_found, z_found, tol)
            if proof is None and project is not None:
                proof = project(x, y_found, z_found)
        else:
            proof = accept_dual(qp, x, y, z, recession(qp, solver), tol)
        if proof is not None:
            return status, proof
    return None


def elastic(
    qp: QP, solver: Solver, x: np.ndarray, least: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return (y, z) of the elastic QP; zeros if x violates `least` at most."""
    n, p = qp.q.size, qp.b.size
    rows = np.flatnonzero(np.isfinite(qp.h))
    G, h, g = unit_rows(qp.G.tocsr()[rows], qp.h[rows] - qp.G[rows] @ x)
    A, b, a = unit_rows(qp.A.tocsr(), qp.b - qp.A @ x)
    k = max(largest(b), -h.min(initial=0.0))
    if not k > least:
        return np.zeros(p), np.zeros(qp.h.size)
    m = rows.size
    free = np.full(m + p, np.inf)
    P = canonical(sparse.block_diag((csc_array((n, n)), sparse.eye_array(m + p))))
    G = canonical(sparse.hstack((G, -sparse.eye_array(m), csc_array((m, p)))))
    A = canonical(sparse.hstack((A, csc_array((p, m)), -sparse.eye_array(p))))
    lb = np.concatenate(((qp.lb - x) / k, -free))
    ub = np.concatenate(((qp.ub - x) / k, free))
    u = solver(QP(P, np.zeros(n + m + p), G, h / k, A, b / k, lb, ub))
    z = np.zeros(qp.h.size)
    z[rows] = u.z / g
    return u.y / a, z


def recession(qp: QP, solver: Solver) -> np.ndarray:
    """Return the projection of -q on the recession cone (columns and rows scaled)."""
    n = qp.q.size
    size = abs(sparse.vstack((qp.P, qp.A, qp.G))).max(axis=0).toarray().ravel()
    scale = 1.0 / np.where(size > 0.0, size, 1.0)
    D = sparse.diags_array(scale)
    rows = np.flatnonzero(np.isfinite(qp.h))
    A, zero_b, _ = unit_rows((sparse.vstack((qp.P, qp.A)) @ D).tocsr())
    G, zero_h, _ = unit_rows(qp.G.tocsr()[rows] @ D)
    q = qp.q * scale
    q /= max(largest(q), LEAST_DIVISOR)
    P, G, A = canonical(sparse.eye_array(n)), canonical(G), canonical(A)
    lb = np.where(np.isfinite(qp.lb), 0.0, -np.inf)
    ub = np.where(np.isfinite(qp.ub), 0.0, np.inf)
    return solver(QP(P, q, G, zero_h, A, zero_b, lb, ub)).x * scale


def unit_rows(M: Any, rhs: Any = 0.0) -> tuple[Any, np.ndarray, np.ndarray]:
    """Return M and rhs, divided by the rows' 2-norms, and these, 1 for empty rows."""
    norms = np.sqrt(np.asarray(M.multiply(M).sum(axis=1)).ravel())
    norms[norms == 0.0] = 1.0
    return sparse.diags_array(1.0 / norms) @ M, rhs / norms, norms


def canonical(M: Any) -> csc_array:
    """Return M as a canonical CSC matrix."""
    return sparse_matrix("a matrix of a fallback QP", M, "csc")
