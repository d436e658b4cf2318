"""Active-set refinement: guess the active constraints, solve, correct the guess.

With the active one-sided constraints, at first those with Z > W, as equations and
without the others,

    [P  A'  G_a'] [x]   [-q ]
    [A          ] [y] = [b  ]      (variables at an active bound held there)
    [G_a        ] [v]   [c_a]

is solved by proximal iterations with the factors of its regularised matrix, which
converge for dependent active rows too. The next guess keeps the active constraints with
multipliers >= 0 and adds the violated ones: a primal-dual active-set method
(Hintermueller, Ito and Kunisch, SIAM J. Optim. 13 (2003) 865-888).

The unknowns are u = (x, y, net z); `held` marks the variables at active bounds and the
inactive rows, which do not change.
"""

import cython
from cython.cimports.libc.math import INFINITY
from cython.cimports.namlcp.limits import look_at_clock
from cython.cimports.namlcp.linalg.vectors import copy
from cython.cimports.namlcp.qp.interior.newton import factor, multiply
from cython.cimports.namlcp.qp.interior.state import offer

# Modulus of a diagonal entry of K~ that fixes a variable or drops a row.
OFF = 1e20
# Unscaled residual that ends the iterations.
RESIDUAL_GOAL = 1e-14
# A first residual below this counts as this in the demand for a tenfold reduction.
SMALL_ENOUGH = 1e-11
# A scaled multiplier or slack below minus this has the wrong sign.
WRONG_SIGN = 1e-12
# Added to the diagonal of P, and subtracted for rows. The second is tried where L D L'
# breaks down with the first, or where the iterations do not reduce the residual
# tenfold: the KKT system of the active set is singular then.
FIRST_SHIFT, SECOND_SHIFT = 1e-9, 1e-7
# MOST_SETS: active sets tried by one refinement at most. PROXIMAL_STEPS: iterations for
# each. GOOD_ENOUGH: residual over its tolerance, on unscaled data, up to which no other
# set is tried.
GOOD_ENOUGH = 1e-2
# Violation of a slack or multiplier over the tolerance above which a point is not worth
# measuring. A set that is FAR off is followed by another only where its violation fell
# to the part FALL of the last one's: sets that lead to the solution gain more, others
# cost a factorisation each.
FAR, FALL = 1e3, 0.3


def refine(m):
    """Try active sets, beginning with the point `start` and its set.

    Offers every point found to the judge. Ends with a residual over its tolerance of
    GOOD_ENOUGH, where that ratio is not halved or the violation does not FALL, or where
    the set does not change. A larger shift that succeeds stays.
    """
    best = violation = INFINITY
    m.regularisation = FIRST_SHIFT
    for _ in range(MOST_SETS):
        with cython.nogil:
            solve_set(m)
            if m.regularisation == FIRST_SHIFT and not m.converged:
                m.regularisation = SECOND_SHIFT
                solve_set(m)
                if not m.converged:
                    m.regularisation = FIRST_SHIFT
        if m.over or not m.is_factored:
            return 0
        if m.set_violation <= FAR * m.tol or not m.set_changed:
            worst = offer(m, m.found)
            if worst <= GOOD_ENOUGH or not worst <= 0.5 * best:
                return 0
            best = worst
        elif not m.set_violation <= FALL * violation:
            return 0
        violation = m.set_violation
        if not m.set_changed:
            return 0
        look_at_clock(m)
        if m.over:
            return 0
        copy(m.found, m.start, m.length)
    return 0


def solve_set(m):
    """Solve the system of the set of `start`; set `found` to its point and next set.

    The iterations end when the residual is rounding, or twice in a row not halved.
    `converged` tells whether it fell tenfold, or below a tenth of SMALL_ENOUGH.
    """
    hold(m)
    m.converged, m.is_factored = False, factor(m)
    if not m.is_factored:
        return
    first = least = INFINITY
    failures = 0
    for k in range(PROXIMAL_STEPS + 1):
        error = set_residual(m)
        failures = 0 if error < 0.5 * least else failures + 1
        if k == 0:
            first = max(error, SMALL_ENOUGH)
        if error < least or k == 0:
            least = error
            copy(m.u, m.least_u, m.size)
        if failures == 2 or k == PROXIMAL_STEPS or not RESIDUAL_GOAL < error < INFINITY:
            break
        m.factors.solve_into(m.r, m.answer)
        for j in range(m.size):
            if not m.held[j]:
                m.u[j] += m.answer[j]
    m.converged = least <= 0.1 * first
    choose_next_set(m)


def hold(m):
    """Set the diagonal of K~, `held`, the right-hand side `goal` and the first u.

    That is (x, y, net z) of `start`, with x moved to its active bounds and z of active
    rows alone.
    """
    n, rows, held, goal, u = m.n, m.n + m.p, m.held, m.goal, m.u
    indptr, base, data, shift = m.indptr, m.base, m.data, m.regularisation
    Z = m.start + rows
    active = Z + m.m
    copy(m.start, u, rows)
    copy(m.goal_b, goal + n, m.p)
    for j in range(rows):
        held[j] = 0.0
    for j in range(rows, m.size):
        held[j], u[j] = 1.0, 0.0
    for k in range(m.m):
        if active[k]:
            i = m.place[k]
            held[i] = i < n
            goal[i] = m.sign[k] * m.goal_c[k]
            u[i] = goal[i] if i < n else m.sign[k] * Z[k]
    for j in range(n):
        last = indptr[j + 1] - 1
        data[last] = OFF if held[j] else base[last] + shift
    for j in range(n, m.size):
        data[indptr[j + 1] - 1] = -OFF if held[j] else -shift


def set_residual(m):
    """Set r to minus the residual of the system; return its unscaled max norm."""
    r, unit = m.r, m.unit
    multiply(m, m.u, m.u, m.Pdx, m.Ctdv, m.dv)
    worst: cython.double = 0.0
    size: cython.double = 0.0
    for j in range(m.size):
        r[j] = 0.0
        if not m.held[j]:
            if j < m.n:
                r[j] = -(m.Pdx[j] + m.cost[j] + m.Ctdv[j])
                size = abs(r[j]) / unit[j]
            else:
                r[j] = m.goal[j] - m.dv[j]
                size = abs(r[j]) * unit[j]
            if not size <= worst:
                worst = size
    return worst


def choose_next_set(m):
    """Set `found`: the point, and the next active set; and the largest violation.

    That set has the active constraints with multipliers >= 0 and the violated ones. The
    multiplier of a bound follows from stationarity.
    """
    u, t, sign, unit, rows = m.least_u, m.dv, m.sign, m.unit, m.n + m.p
    active, Z = m.start + rows + m.m, m.found + rows
    chosen = Z + m.m
    multiply(m, u, u, m.Pdx, m.Ctdv, t)
    copy(u, m.found, rows)
    m.set_changed = False
    violation: cython.double = 0.0
    for k in range(m.m):
        j = m.place[k]
        if active[k]:
            gradient = u[j] if j >= m.n else -(m.Pdx[j] + m.cost[j] + m.Ctdv[j])
            multiplier = sign[k] * gradient
            violation = max(violation, -multiplier / unit[j])
            chosen[k] = multiplier > -WRONG_SIGN
            Z[k] = max(multiplier, 0.0)
        else:
            slack = m.goal_c[k] - sign[k] * t[j]
            violation = max(violation, -slack * unit[j])
            chosen[k] = slack < -WRONG_SIGN
            Z[k] = 0.0
        if chosen[k] != active[k]:
            m.set_changed = True
    m.set_violation = violation
