"""Stage 1 of norm 2 for few or full rows, by Newton's method on the violated ones.

With r eliminated, the function of x to be minimised within lb <= x <= ub is convex and
piecewise quadratic,

    phi(x) = 1/2 sum w_i (C_i x - d_i)^2   over the rows that are violated at x
                                           (equalities: over all).

A step minimises the piece of the present x over the variables that are free, those not
held at a bound by the sign of the gradient (Bertsekas, SIAM J. Control Optim. 20 (1982)
221-246), with the proximal term PROXIMAL/2 |x' - x|^2 that makes it strictly convex. It
is shortened by an exact line search, and clipped to the bounds. Without bounds it ends
after finitely many pieces (Bramley and Winnicka, SIAM J. Sci. Comput. 17 (1996)).
"""

from typing import Any, NamedTuple

import numpy as np

from namlcp.compiled import kernel, part
from namlcp.limits import Limits
from namlcp.linalg import (
    add_scaled,
    cholesky,
    cholesky_solve,
    copy,
    matvec,
    product,
)
from namlcp.qp.closest.rows import Rows
from namlcp.qp.forms import TINY_ENTRIES, are_full

PROXIMAL = 1e-10
"""The proximal weight, relative to the largest diagonal entry of the Hessian."""

EXACT = 1e-13
"""The search ends where the gradient is this small relative to its terms: rounding."""

STEPS = 30
"""Most steps. Random problems and controllers with 20 to 900 rows take 2 to 21. Where
shifts are small against the sides, or C is mostly zeros, it may take hundreds; the QP
in x and the shifts takes over."""

HALVINGS = 50
"""Most trials of a line search; 2 to 6 are usual."""

SAME = 1e-15
"""Relative difference of two lengths of a step that counts as rounding."""

SUFFICIENT = 1e-4
"""The part of the descent by the gradient alone that a clipped step must reach."""

UNWATCHED = 1e8
"""Operations between two looks at the clock, a twentieth of a second."""

GOES_ON, ENDED, STUCK = 0, 1, 2
"""Codes of `descend`: `most` steps taken; phi is least; no step makes it smaller."""


def suits_newton(rows: Rows) -> bool:
    """Tell whether C is tiny or full, and every row may take a finite shift."""
    return (
        rows.norm == 2
        and are_full((rows.C,), TINY_ENTRIES)
        and bool(np.isfinite(rows.weights).all() and (rows.d > -np.inf).all())
        and bool((rows.lb <= rows.ub).all())
    )


def solve_by_newton(rows: Rows, limits: Limits) -> np.ndarray | None:
    """Return an x with least shifts of suitable rows, None where it is not found."""
    x = np.minimum(np.maximum(np.zeros(rows.lb.size), rows.lb), rows.ub)
    if not np.isfinite(x).all():  # no x is within such bounds
        return None
    limits.announce(descend)
    n, m = x.size, rows.d.size
    work = n * (n * (n + m) + 2 * HALVINGS * m)
    most = min(1 + int(UNWATCHED / (work + 1)), STEPS)
    C = rows.C if isinstance(rows.C, np.ndarray) else rows.C.toarray(order="C")
    problem = C, rows.d, rows.weights, m - rows.p, rows.lb, rows.ub
    for _ in range(0, STEPS, most):
        code = descend(*problem, x, most)
        if code == ENDED:
            return x
        if code == STUCK or limits.deadline.reached():
            break
    return None


class Problem(NamedTuple):
    """The rows and bounds; rows from number `inequalities` on are equalities."""

    C: Any
    d: Any
    w: Any
    inequalities: Any
    lb: Any
    ub: Any


class Space(NamedTuple):
    """The vectors of a step, and memory.

    r: the violations C x - d, new_r those after the step. v = w r in the violated rows,
    else 0. g = C'v, with the moduli of its terms added up in `terms`. free: the numbers
    of the free variables. step: Newton's step, moved = C step; u: its free part. new:
    the x after the step. S and H: the violated rows and the Hessian, free columns only.
    """

    r: Any
    new_r: Any
    moved: Any
    v: Any
    g: Any
    terms: Any
    free: Any
    step: Any
    u: Any
    new: Any
    S: Any
    H: Any


@kernel
def descend(C, d, w, inequalities, lb, ub, x, most):
    """Take up to `most` steps from x, which is overwritten; return a code."""
    m, n = C.shape
    p = Problem(C, d, w, inequalities, lb, ub)
    s = Space(
        np.empty(m), np.empty(m), np.empty(m), np.empty(m), np.empty(n), np.empty(n),
        np.empty(n, dtype=np.int64), np.empty(n), np.empty(n), np.empty(n),
        np.empty((n, m)), np.empty(n * n),
    )  # fmt: skip
    set_violations(p, x, s.r)
    for _ in range(most):
        set_gradient(p, s)
        k = choose_free(p, x, s)
        if k < 0:
            return ENDED
        if not set_step(p, k, s):
            return STUCK
        matvec(C, s.step, s.moved)
        if not set_next(p, x, line_search(p, s), s):
            return STUCK
        copy(s.new, x)
        copy(s.new_r, s.r)
    return GOES_ON


@part
def value(p, r):
    """Return phi where the violations are r."""
    total, w, inequalities = 0.0, p.w, p.inequalities
    for i in range(r.size):
        if r[i] > 0.0 or i >= inequalities:
            total += w[i] * r[i] * r[i]
    return 0.5 * total


@part
def set_violations(p, x, r):
    """Set r to C x - d."""
    matvec(p.C, x, r)
    add_scaled(-1.0, p.d, r)


@part
def set_gradient(p, s):
    """Set v, g and `terms`."""
    C, w, r, v, g, terms = p.C, p.w, s.r, s.v, s.g, s.terms
    for j in range(g.size):
        g[j] = terms[j] = 0.0
    for i in range(r.size):
        v[i] = 0.0
        if r[i] > 0.0 or i >= p.inequalities:
            v[i] = w[i] * r[i]
            for j in range(g.size):
                term = v[i] * C[i, j]
                g[j] += term
                terms[j] += abs(term)


@part
def choose_free(p, x, s):
    """Set `free` and return how many; -1 if phi is least, so that no step is needed."""
    lb, ub, g, terms, free = p.lb, p.ub, s.g, s.terms, s.free
    k, worst, size = 0, 0.0, 0.0
    for j in range(x.size):
        size = max(size, terms[j])
        at_lb, at_ub = x[j] <= lb[j], x[j] >= ub[j]
        held = (at_lb and g[j] > 0.0) or (at_ub and g[j] < 0.0)
        if not (held or (at_lb and at_ub)):
            worst = max(worst, abs(g[j]))
            free[k] = j
            k += 1
    return -1 if worst <= EXACT * size else k


@part
def set_step(p, k, s):
    """Set the step in the k free variables; tell whether there is one."""
    C, w, r, S, g, free, step, u = p.C, p.w, s.r, s.S, s.g, s.free, s.step, s.u
    used = 0
    for i in range(r.size):
        if r[i] > 0.0 or i >= p.inequalities:
            root = np.sqrt(w[i])
            for a in range(k):
                S[a, used] = root * C[i, free[a]]
            used += 1
    half, H = S[:k, :used], s.H[: k * k].reshape((k, k))
    product(1.0, half, half, 0.0, H)
    largest = 0.0
    for a in range(k):
        largest = max(largest, H[a, a])
    for a in range(k):
        H[a, a] += PROXIMAL * largest
        u[a] = -g[free[a]]
    if cholesky(H) != 0:
        return False
    cholesky_solve(H, u[:k])
    for j in range(step.size):
        step[j] = 0.0
    for a in range(k):
        step[free[a]] = u[a]
    return True


@part
def line_search(p, s):
    """Return the t in [0, 1] that minimises phi along the step without its bounds.

    The derivative of phi in t is piecewise linear and rises; its zero is found by
    Newton's method, or halving where that leaves the interval known to contain it.
    """
    low, high, t = 0.0, 1.0, 1.0
    for _ in range(HALVINGS):
        slope, rise = slope_at(t, p.w, s.r, s.moved, p.inequalities)
        if slope > 0.0:
            high = t
        else:
            low = t
        if low == 1.0 or rise == 0.0:
            break
        last, t = t, t - slope / rise
        if not low < t < high:
            t = 0.5 * (low + high)
        if abs(t - last) <= SAME * t:
            break
    return t


@part
def slope_at(t, w, r, moved, inequalities):
    """Return the first and the second derivative of phi in t at x + t step."""
    slope, rise = 0.0, 0.0
    for i in range(r.size):
        at = r[i] + t * moved[i]
        if at > 0.0 or i >= inequalities:
            weighed = w[i] * moved[i]
            slope += weighed * at
            rise += weighed * moved[i]
    return slope, rise


@part
def set_next(p, x, t, s):
    """Set `new` to x + t step clipped to the bounds, t halved until phi falls enough.

    Returns whether it does. A step that stays within the bounds needs no such test.
    """
    lb, ub, g, step, new = p.lb, p.ub, s.g, s.step, s.new
    before = value(p, s.r)
    for _ in range(HALVINGS):
        is_inside, descent = True, 0.0
        for j in range(x.size):
            new[j] = x[j] + t * step[j]
            if new[j] < lb[j] or new[j] > ub[j]:
                is_inside = False
                new[j] = min(max(new[j], lb[j]), ub[j])
            descent += g[j] * (x[j] - new[j])
        set_violations(p, new, s.new_r)
        if is_inside or before - value(p, s.new_r) >= SUFFICIENT * descent > 0.0:
            return True
        t *= 0.5
    return False
