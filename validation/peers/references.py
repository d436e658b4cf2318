"""Solutions to more digits than a solver returns, and the error of a point.

Of a strictly convex QP the active set of any good point decides the solution: a linear
system, solved here with residuals in extended precision until they no longer fall, and
then accepted only if every constraint and every multiplier it leaves out has the right
sign. Whoever proposes the active set, what passes is the solution.
"""

from typing import Any

import numpy as np
import scipy.sparse as sp
from qpsolvers import Problem, Solution
from scipy.sparse.linalg import splu

from validation.harness import qps

WIDE = np.longdouble
STEPS = 30
ACCEPTED = 1e-11  # of the largest term: the wrong sign of a constraint or multiplier
STRICT = 1e-9  # least pivot of P, scaled to unit diagonal
REGULAR = 1e-9  # on the rows of active constraints, which may depend on each other


def strictly_convex(P: Any) -> bool:
    """Tell whether P has an inverse worth the name: pivots of its unit-diagonal form.

    A is scaled by d_i = p_ii^(-1/2) on both sides; a zero on its diagonal decides.
    """
    diagonal = np.asarray(P.diagonal())
    if not np.all(diagonal > 0.0):
        return False
    d = sp.diags_array(1.0 / np.sqrt(diagonal))
    if not sp.issparse(P):
        return bool(np.linalg.eigvalsh(d @ P @ d)[0] > STRICT)
    # without pivoting the pivots of a positive definite matrix are positive
    mode = {"SymmetricMode": True}
    scaled = sp.csc_matrix(d @ P @ d)
    factors = splu(scaled, "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=mode)
    return bool(factors.U.diagonal().min() > STRICT)


def stacked(problem: Problem) -> tuple[sp.csr_array, np.ndarray, int]:
    """Return C, d and p: equalities C x = d in the first p rows, C x <= d below.

    The order is A, G, then the finite upper and lower bounds.
    """
    _, q, G, h, A, b, lb, ub = qps.parts(problem)
    eye = sp.csr_array(sp.eye_array(q.size, format="csr"))
    up, low = np.isfinite(ub), np.isfinite(lb)
    C = sp.vstack([sp.csr_array(A), sp.csr_array(G), eye[up], -eye[low]])
    return sp.csr_array(C), np.concatenate([b, h, ub[up], -lb[low]]), b.size


def multipliers(problem: Problem, solution: Solution) -> np.ndarray:
    parts = [np.zeros(0)]
    parts += [solution.y] if problem.A is not None else []
    parts += [solution.z] if problem.G is not None else []
    for sign, bound in ((1.0, problem.ub), (-1.0, problem.lb)):
        if bound is not None:
            parts.append(np.maximum(sign * solution.z_box[np.isfinite(bound)], 0.0))
    return np.concatenate(parts)


def reference(problem: Problem, solution: Solution) -> np.ndarray | None:
    """Return the solution of a strictly convex QP, None if it cannot be certified.

    `solution` proposes the active set: what has a larger multiplier than slack.
    """
    if solution.x is None or not strictly_convex(problem.P):
        return None
    C, d, p = stacked(problem)
    slack = d - C @ solution.x
    active = multipliers(problem, solution) > slack
    active[:p] = True
    P = sp.csr_array(problem.P)
    B, side = C[active], d[active]
    m = side.size
    shift = sp.diags_array(np.full(m, -REGULAR))
    factors = splu(sp.csc_matrix(sp.block_array([[P, B.T], [B, shift]])))
    K = sp.block_array([[P, B.T], [B, None]], format="csr").astype(WIDE)
    right = np.r_[-problem.q, side].astype(WIDE)
    point = np.zeros(right.size, WIDE)
    for _ in range(STEPS):
        correction = factors.solve((right - K @ point).astype(float))
        point += correction
        if np.abs(correction).max() <= 1e-19 * np.abs(point).max():
            break
    x, y = point[: problem.q.size], point[problem.q.size :]
    slack = d - C.astype(WIDE) @ x
    terms = 1.0 + np.abs(d) + abs(C) @ np.abs(x)
    size = 1.0 + np.abs(problem.q).max() + np.abs(P.astype(WIDE) @ x).max()
    right_signs = np.all(slack[~active] >= -ACCEPTED * terms[~active])
    right_signs &= np.all(y[int(p) :] >= -ACCEPTED * size)
    solved = np.abs(right - K @ point).max() <= ACCEPTED * size
    return x.astype(float) if right_signs and solved else None


def distance(x: np.ndarray, exact: np.ndarray) -> float:
    return float(np.abs(x - exact).max() / max(np.abs(exact).max(), 1e-300))
