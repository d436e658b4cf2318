"""Stage 1 of norm 2 for dense rows, by Newton's method on the violated ones.

With r eliminated, the function of x to be minimised is convex and piecewise quadratic,

    phi(x) = 1/2 sum w_i (C_i x - d_i)^2   over the soft rows that are violated at x
                                           (equalities: over all),

within the rows that must stay and the bounds. A step minimises the piece of the present
x: a QP in the n variables, with the proximal term PROXIMAL/2 |x' - x|^2 that makes it
strictly convex. Exact line searches let it end after finitely many pieces (Bramley and
Winnicka, SIAM J. Sci. Comput. 17 (1996), for rows without the other constraints).
"""

from collections.abc import Callable

import numpy as np

from namlcp.limits import Limits
from namlcp.qp.answer import Answer
from namlcp.qp.closest.rows import Rows, largest
from namlcp.qp.guess import NO_GUESS, Guess
from namlcp.qp.problem import QP, Point
from namlcp.residuals import UNDEFINED
from namlcp.status import Status

Solve = Callable[[QP, Guess, Limits], Answer]

PROXIMAL = 1e-10
"""The proximal weight, relative to the largest diagonal entry of the Hessian."""

EXACT = 1e-13
"""The search ends where the gradient is this small relative to its terms: rounding."""

STEPS = 20
"""Most steps; random problems with 20 to 400 rows take 4 to 9."""

HALVINGS = 50
"""Bisections of a line search, to the last digit of a step."""


def solve_by_newton(rows: Rows, limits: Limits, solve: Solve) -> Answer | None:
    """Return x and the multipliers of all rows and bounds.

    None where it does not end, or a side or bound is infinite and excludes every x.
    """
    soft = np.isfinite(rows.weights)
    m = rows.d.size - rows.p
    parts = rows.C, rows.d, rows.weights, rows.is_equality
    C, d, w, equality = (part[soft] for part in parts)
    x = np.minimum(np.maximum(np.zeros(rows.lb.size), rows.lb), rows.ub)
    if (d == -np.inf).any() or not np.isfinite(x).all():
        return None
    above, equal = np.flatnonzero(~soft[:m]), m + np.flatnonzero(~soft[m:])
    stay = rows.C[above], rows.d[above], rows.C[equal], rows.d[equal]
    moduli = np.abs(rows.C)
    for count in range(STEPS):
        r = C @ x - d
        used = (r > 0.0) | equality
        S = C[used]
        H = (S.T * w[used]) @ S
        proximal = PROXIMAL * (H.diagonal().max(initial=0.0) or 1.0)
        H[np.diag_indices_from(H)] += proximal
        q = -(S.T @ (w[used] * d[used]) + proximal * x)
        piece = solve(QP(H, q, *stay, rows.lb, rows.ub), NO_GUESS, limits)
        if piece.status is Status.PRIMAL_INFEASIBLE:
            return piece
        if piece.status is not Status.SOLVED:
            return None
        new, y, z, z_box = piece.point
        v = np.zeros(rows.d.size)
        v[above], v[equal] = z, y
        v[soft] = w * np.where(equality, C @ new - d, np.maximum(C @ new - d, 0.0))
        gradient, terms = v @ rows.C + z_box, np.abs(v) @ moduli + np.abs(z_box)
        if largest(gradient) <= EXACT * largest(terms):
            point = Point(new, v[m:], v[:m], z_box)
            return Answer(Status.SOLVED, point, UNDEFINED, count + 1, "newton")
        step = line_search(r, C @ (new - x), w, equality)
        x = x + step * (new - x) if step < 1.0 else new
    return None


def line_search(
    r: np.ndarray, change: np.ndarray, w: np.ndarray, equality: np.ndarray
) -> float:
    """Return the t in [0, 1] that minimises phi where the violations are r + t change.

    The derivative of phi in t rises.
    """

    def slope(t: float) -> float:
        at = r + t * change
        return float(np.where(equality, at, np.maximum(at, 0.0)) @ (w * change))

    low, high = 0.0, 1.0
    if slope(high) <= 0.0:
        return high
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if slope(middle) <= 0.0 else (low, middle)
    return 0.5 * (low + high)
