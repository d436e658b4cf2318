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

The unknowns are set_x and set_v = (0, y, net z); `held` marks the variables at active
bounds and the inactive rows, which do not change.
"""

import cython
from cython.cimports.libc.math import INFINITY
from cython.cimports.namlcp.linalg.vectors import copy, fill
from cython.cimports.namlcp.qp.interior.newton import factor
from cython.cimports.namlcp.qp.interior.state import offer
from cython.cimports.namlcp.qp.interior.steps import multiply
from cython.cimports.namlcp.watch import look_at_clock

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
    """Try active sets, set_active first, from start_x, start_y, start_Z on.

    Offers every point found to the judge. Ends with a residual over its tolerance of
    GOOD_ENOUGH, where that ratio is not halved or the violation does not FALL, or where
    the set does not change.
    """
    best = violation = INFINITY
    m.regularisation, m.most_solves = FIRST_SHIFT, PROXIMAL_STEPS
    for _ in range(MOST_SETS):
        with cython.nogil:
            solve_shifted(m)
        if m.over or not m.is_factored:
            return 0
        if m.set_violation <= FAR * m.tol or not m.set_changed:
            worst = offer(m, m.set_x, m.set_y, m.set_Z)
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
        for k in range(m.m):
            m.set_active[k] = m.next_active[k]
        copy(m.set_x, m.start_x, m.n)
        copy(m.set_y, m.start_y, m.p)
        copy(m.set_Z, m.start_Z, m.m)
    return 0


def solve_shifted(m):
    """Solve the system, with the larger shift if the smaller one does not suffice.

    If that does, it stays.
    """
    is_small: cython.bint = m.regularisation == FIRST_SHIFT
    solve_from_start(m)
    if is_small and not m.converged:
        m.regularisation = SECOND_SHIFT
        solve_from_start(m)
        if not m.converged:
            m.regularisation = FIRST_SHIFT


def solve_from_start(m):
    """Do as `solve_set` from start_x, start_y and start_Z on."""
    copy(m.start_x, m.set_x, m.n)
    copy(m.start_y, m.set_y, m.p)
    copy(m.start_Z, m.set_Z, m.m)
    solve_set(m)


def solve_set(m):
    """Solve the system of set_active from set_x, set_y and set_Z on."""
    hold(m)
    m.converged = False
    m.is_factored = factor(m)
    if m.is_factored:
        while not is_set_solved(m):
            m.factors.solve_into(m.r, m.answer)
            correct_set(m)
        choose_next_set(m)


def hold(m):
    """Set the diagonal of K~, `held`, the right-hand side `goal` and the first point.

    That is set_x, moved to its active bounds, and v = (0, set_y, set_Z where active).
    """
    n, rows, held, goal = m.n, m.n + m.p, m.held, m.goal
    indptr, base, data, shift = m.indptr, m.base, m.data, m.regularisation
    for j in range(m.size):
        held[j] = j >= rows
    fill(m.set_v, 0.0, m.size)
    copy(m.set_y, m.set_v + n, m.p)
    copy(m.goal_b, goal + n, m.p)
    for k in range(m.m):
        if m.set_active[k]:
            i = m.place[k]
            held[i] = i < n
            goal[i] = m.sign[k] * m.goal_c[k]
            if i < n:
                m.set_x[i] = goal[i]
            else:
                m.set_v[i] = m.sign[k] * m.set_Z[k]
    for j in range(n):
        last = indptr[j + 1] - 1
        data[last] = OFF if held[j] else base[last] + shift
    for j in range(n, m.size):
        data[indptr[j + 1] - 1] = -OFF if held[j] else -shift
    m.first_error = m.least_error = INFINITY
    m.failures = m.solves = 0


def set_residual(m):
    """Set r to minus the residual of the system; return its unscaled max norm."""
    r, unit = m.r, m.unit
    multiply(m, m.set_x, m.set_v, m.Pdx, m.Ctdv, m.dv)
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


def is_set_solved(m):
    """Measure the point; tell whether the iterations end, with the best point kept.

    They end when the residual is rounding, or twice in a row not halved. `converged`
    tells whether it fell tenfold, or below a tenth of SMALL_ENOUGH.
    """
    error = set_residual(m)
    if m.solves == 0:
        m.first_error = max(error, SMALL_ENOUGH)
    m.failures = 0 if error < 0.5 * m.least_error else m.failures + 1
    if error < m.least_error or m.solves == 0:
        m.least_error = error
        copy(m.set_x, m.kept_x, m.n)
        copy(m.set_v, m.kept_v, m.size)
    goes_on: cython.bint = error > RESIDUAL_GOAL and m.failures < 2 and error < INFINITY
    if goes_on and m.solves < m.most_solves:
        return False
    copy(m.kept_x, m.set_x, m.n)
    copy(m.kept_v, m.set_v, m.size)
    m.converged = m.least_error <= 0.1 * m.first_error
    return True


def correct_set(m):
    """Add `answer` to what is not held."""
    for j in range(m.size):
        if not m.held[j]:
            if j < m.n:
                m.set_x[j] += m.answer[j]
            else:
                m.set_v[j] += m.answer[j]
    m.solves += 1


def choose_next_set(m):
    """Set set_y, set_Z, the largest violation, and the next active set.

    That has the active constraints with multipliers >= 0 and the violated ones. The
    multiplier of a bound follows from stationarity.
    """
    v, t, sign, unit = m.set_v, m.dv, m.sign, m.unit
    multiply(m, m.set_x, v, m.Pdx, m.Ctdv, t)
    copy(v + m.n, m.set_y, m.p)
    m.set_changed = False
    violation: cython.double = 0.0
    for k in range(m.m):
        j = m.place[k]
        if m.set_active[k]:
            gradient = v[j] if j >= m.n else -(m.Pdx[j] + m.cost[j] + m.Ctdv[j])
            multiplier = sign[k] * gradient
            violation = max(violation, -multiplier / unit[j])
            m.next_active[k] = multiplier > -WRONG_SIGN
            m.set_Z[k] = max(multiplier, 0.0)
        else:
            slack = m.goal_c[k] - sign[k] * t[j]
            violation = max(violation, -slack * unit[j])
            m.next_active[k] = slack < -WRONG_SIGN
            m.set_Z[k] = 0.0
        if m.next_active[k] != m.set_active[k]:
            m.set_changed = True
    m.set_violation = violation
