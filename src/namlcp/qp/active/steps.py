"""The dual active-set method on responses: a dual Schur-complement method.

The inequalities c x <= d and the bounds of the variables are rows: row i < m is row i
of G, row m + j the unit row e_j with two sides, lb_j and ub_j. The base problem is the
QP without them; with its solution operator, (x, y) = K^-1 (-q, b). A multiplier mu of
row c changes the values s = (G x, x, y) by -mu w_c, where w_c, the *response* to the
row, is (G u, u, v) for (u, v) = K^-1 (c, 0). Responses depend on the matrices alone,
and are kept from solve to solve. With the active rows F, S = (w_i)_j, i, j in F, L L' =
S, and s0 the values of the base solution:

1. mu = S^-1 (s0_F - d_F); while one has the wrong sign, the row of the worst is removed
   from F. s = s0 - sum mu_i w_i.
2. The row violated most enters: t, its multiplier, grows, mu_F -= t r with
   r = S^-1 w_F, and s -= t (w - sum r_i w_i), until the row holds with equality (full
   step) or an active multiplier is zero, whose row is removed (partial step). If
   neither ends the step, the multipliers (-r, 1) contradict the rows.
3. Once no row is violated, F is sorted and mu and s are computed anew from s0
   (`finish`): the answer depends on F alone, not on the way to it.

This is the method of Goldfarb and Idnani (Math. Programming 27 (1983) 1-33) in the form
of Bartlett and Biegler (QPSchur, Optim. Eng. 7 (2006) 5-32). Signs: multipliers mu
are >= 0 for a row at h or ub (side 1) and <= 0 for one at lb (side -1).
"""

import cython
from cython import Py_ssize_t
from cython.cimports.libc.math import INFINITY, fabs, isinf, sqrt
from cython.cimports.namlcp.linalg.dense import (
    append_to_triangle,
    remove_from_triangle,
    triangle_solve,
    triangle_solve_transposed,
)
from cython.cimports.namlcp.linalg.vectors import add_scaled, copy, dot
from cython.cimports.namlcp.qp.active.rows import (
    goal_of,
    is_pinned,
    response_of,
    solve_active,
    subtract_responses,
)
from cython.cimports.namlcp.qp.active.state import (
    CONTRADICTION,
    DONE,
    LATE,
    STUCK,
)
from cython.cimports.namlcp.watch import is_over

from namlcp.options import DEFAULT_OPTIONS

USUAL = DEFAULT_OPTIONS.max_iter
# A row depends on the active ones if the squared length of its part orthogonal to them,
# in the metric of the responses, over its own is at most DEPENDENT; for rows of a hint,
# which need not be right, DEPENDENT_HINT.
DEPENDENT, DEPENDENT_HINT = 1e-11, 1e-6
# Violations over the moduli of their terms up to which they count as rounding at first.
# This `level` grows tenfold where a violation below NOISE * level contradicts the
# active rows; above MOST_ROUNDING the method gives up. The larger numbers are those of
# the rounds of `proximal`, whose base point is far away.
VIOLATION_ROUNDING, NOISE, MOST_ROUNDING = 1e-13, 1e3, 1e-9
ROUND_ROUNDING, MOST_ROUND_ROUNDING = 1e-12, 1e-7
# Rounding of s over the largest entry of s0 from which it was subtracted: what is left
# at a vertex x = 0. Rows that are active are allowed `level` of it.
BASE_ROUNDING = 4e-16
# MOST_PIVOTS: pivots at most, per row and variable; another method is safer for a QP
# that needs more. A limit of USUAL is not the user's choice, and is exceeded up to
# GROWN per row and variable; see also m.most_operations.
# MOST_SORTED: most active rows for which L is always computed anew at the end, which
# takes k^3 / 6 operations; MOST_AGE: most changes of a larger L before it is.


def remove_row(m, i):
    """Remove the active row number i."""
    m.side[m.active[i]] = 0
    remove_from_triangle(m.triangle, m.k, i, m.cosines, m.sines)
    for j in range(i, m.k - 1):
        m.active[j], m.multiplier[j] = m.active[j + 1], m.multiplier[j + 1]
    m.k -= 1
    m.changed = True
    m.age += 1


def append_row(m, row, side, multiplier, length):
    """Make a row active; m.coefficient = L^-1 w_F, `length` the new entry of L."""
    append_to_triangle(m.triangle, m.k, m.coefficient, length)
    m.active[m.k], m.multiplier[m.k] = row, multiplier
    m.side[row] = side
    m.k += 1
    m.changed = True
    m.age += 1


def rest_of(m, row):
    """Return the squared length of w_row orthogonal to the active rows.

    Sets m.coefficient = L^-1 w_F; negative or 0 where rounding is all that is left.
    """
    w, coefficient = response_of(m, row), m.coefficient
    for i in range(m.k):
        coefficient[i] = w[m.active[i]]
    triangle_solve(m.triangle, m.k, coefficient)
    return w[row] - dot(coefficient, coefficient, m.k)


def is_dependent(m, row, rest, limit):
    """Tell whether a row with this `rest_of` depends on equations and active rows."""
    scale, whole = m.scale[row], response_of(m, row)[row]
    if m.k == m.most or m.k >= most_independent(m):
        return True
    return not (rest > limit * whole and rest * scale * scale > m.least_curvature)


def most_independent(m):
    """Return how many rows may be active, for the rank of the equations."""
    return m.n - m.p + m.skipped


# ---- step 1


def recall(m):
    """Make the rows active that were so in the last solved QP, less lost sides."""
    for i in range(m.k):
        m.side[m.active[i]] = 0
    m.k, m.changed, m.operations = m.kept_k, False, 0.0
    m.age = m.kept_age if m.k > 0 else 0
    for i in range(m.k):
        m.active[i] = m.kept_active[i]
        m.side[m.active[i]] = m.kept_side[i]
    copy(m.kept_triangle, m.triangle, m.k * (m.k + 1) // 2)
    for i in range(m.k - 1, -1, -1):
        if isinf(goal_of(m, m.active[i], m.side[m.active[i]])):
            remove_row(m, i)


def keep(m):
    """Note the active rows as those of the last solved QP."""
    for i in range(m.k):
        m.kept_active[i], m.kept_side[i] = m.active[i], m.side[m.active[i]]
    m.kept_k, m.kept_age, m.hints = m.k, m.age, 0
    m.triangle, m.kept_triangle = m.kept_triangle, m.triangle


def admit_hints(m):
    """Append those rows of the hint, the first m.hints kept, that are independent."""
    for i in range(m.hints):
        row, side = m.kept_active[i], m.kept_side[i]
        is_new: cython.bint = m.side[row] == 0 and m.k < m.most
        if is_new and not isinf(goal_of(m, row, side)):
            if m.place[row] < 0:
                m.make_response(row)
            rest = rest_of(m, row)
            if not is_dependent(m, row, rest, DEPENDENT_HINT):
                append_row(m, row, side, 0.0, sqrt(rest))


def set_multipliers(m):
    """Set mu = S^-1 (s0_F - d_F)."""
    for i in range(m.k):
        row = m.active[i]
        m.multiplier[i] = m.s0[row] - goal_of(m, row, m.side[row])
    solve_active(m, m.multiplier)
    for i in range(m.k):
        if is_pinned(m, m.active[i]):
            m.side[m.active[i]] = 1 if m.multiplier[i] >= 0.0 else -1


def set_point_values(m):
    """Set s = s0 - sum mu_i w_i."""
    copy(m.s0, m.s, m.length)
    subtract_responses(m, m.multiplier, m.k, m.s)


def drop_wrong_signs(m):
    """Step 1: remove active rows until all multipliers have the sign of their side."""
    while True:
        set_multipliers(m)
        leaving: Py_ssize_t = -1
        least = 0.0
        for i in range(m.k):
            signed = m.side[m.active[i]] * m.multiplier[i]
            if signed < least:
                leaving, least = i, signed
        if leaving < 0:
            break
        remove_row(m, leaving)
    set_point_values(m)


# ---- step 2


def size_of(m, values):
    """Return the largest |x_j| over the norm of its row, for values (G x, x, ...)."""
    size = 0.0
    for i in range(m.m, m.rows):
        size = max(size, fabs(values[i]) * m.scale[i])
    return size


def choose_entering(m):
    """Set m.entering and its side: the row violated most for its norm, -1 for none."""
    s, scale, h, lb, ub, side = m.s, m.scale, m.h, m.lb, m.ub, m.side
    x, unit = s + m.m, scale + m.m
    level, rounding = m.level, m.level * size_of(m, s)
    held = max(rounding, level * m.base_size)
    rounding = max(rounding, BASE_ROUNDING * m.base_size)
    entering: Py_ssize_t = -1
    at: Py_ssize_t = 1
    worst = 0.0
    for i in range(m.m):
        violation = (s[i] - h[i]) * scale[i]
        if violation > worst:
            least = held if side[i] != 0 else rounding
            if violation > level * fabs(h[i]) * scale[i] + least:
                entering, worst = i, violation
    for j in range(m.n):
        least = held if side[m.m + j] != 0 else rounding
        violation = (x[j] - ub[j]) * unit[j]
        if violation > worst:
            if violation > level * fabs(ub[j]) * unit[j] + least:
                entering, worst, at = m.m + j, violation, 1
        violation = (lb[j] - x[j]) * unit[j]
        if violation > worst:
            if violation > level * fabs(lb[j]) * unit[j] + least:
                entering, worst, at = m.m + j, violation, -1
    m.entering, m.entering_side, m.own = entering, at, 0.0


def step(m):
    """Let the multiplier of the entering row grow until a step ends: DONE if it can.

    After a full step m.entering = -1.
    """
    row, sign, k = m.entering, m.entering_side, m.k
    rest = rest_of(m, row)
    dependent: cython.bint = is_dependent(m, row, rest, DEPENDENT)
    copy(m.coefficient, m.ratio, k)
    triangle_solve_transposed(m.triangle, k, m.ratio)
    leaving: Py_ssize_t = -1
    t = INFINITY
    for i in range(k):
        side = m.side[m.active[i]]
        falls, signed = sign * side * m.ratio[i], side * m.multiplier[i]
        if falls > 0.0 and signed < t * falls and not is_pinned(m, m.active[i]):
            leaving, t = i, signed / falls
    t = max(t, 0.0)
    if leaving < 0 or not dependent:
        copy(response_of(m, row), m.direction, m.length)
        subtract_responses(m, m.ratio, k, m.direction)
    if not dependent:
        full = sign * (m.s[row] - goal_of(m, row, sign)) / rest
        if full <= t:
            leaving, t = -1, full
        add_scaled(-sign * t, m.direction, m.s, m.length)
    elif leaving < 0:
        return CONTRADICTION
    for i in range(k):
        m.multiplier[i] -= sign * t * m.ratio[i]
    m.own += t
    if leaving >= 0:
        remove_row(m, leaving)
    else:
        append_row(m, row, sign, sign * m.own, sqrt(rest))
        m.entering = -1
    return DONE


def is_noise(m):
    """Tell whether the violation of the entering row may be due to rounding errors."""
    row = m.entering
    goal, scale = goal_of(m, row, m.entering_side), m.scale[row]
    terms = fabs(goal) * scale + size_of(m, m.s)
    return fabs(m.s[row] - goal) * scale <= NOISE * m.level * terms


def has_next(m):
    """Choose the entering row, unless there is none or there were too many."""
    choose_entering(m)
    if m.entering < 0:
        return False
    m.pivots += 1
    most = max(USUAL, GROWN * m.rows) if m.max_iter == USUAL else m.max_iter
    return m.pivots <= min(most, MOST_PIVOTS * (m.rows + 1))


def excuse(m):
    """Leave a row that contradicts the active ones, if that may be due to rounding.

    CONTRADICTION if it cannot, STUCK if the rounding errors would be too large.
    """
    if not is_noise(m):
        return CONTRADICTION
    m.level *= 10.0
    m.entering = -1
    most = MOST_ROUND_ROUNDING if m.rho > 0.0 else MOST_ROUNDING
    return STUCK if m.level > most else DONE


def pivot(m):
    """Step 2, as often as a row is violated: DONE, or why it ended before."""
    while True:
        if m.entering < 0:
            if not has_next(m):
                return DONE if m.entering < 0 else STUCK
            if m.place[m.entering] < 0:
                m.make_response(m.entering)
        operations: cython.double = (m.k + 2) * (m.length + m.k)
        if is_over(m, operations):
            return LATE
        m.operations += operations
        is_full: cython.bint = m.k == m.most
        if is_full and m.k < min(most_independent(m), m.rows):
            return STUCK
        if m.operations > m.most_operations:
            return STUCK
        if step(m) == CONTRADICTION:
            found = excuse(m)
            if found != DONE:
                return found
            drop_wrong_signs(m)  # without the partial steps towards this row


# ---- step 3


def sort_active(m):
    """Sort the active rows."""
    for i in range(1, m.k):
        row = m.active[i]
        j = i
        while j > 0 and m.active[j - 1] > row:
            m.active[j] = m.active[j - 1]
            j -= 1
        m.active[j] = row


def factor_active(m):
    """Compute L from the responses; tell whether all rows are independent."""
    count, m.k = m.k, 0
    fine: cython.bint = True
    while fine and m.k < count:
        rest = rest_of(m, m.active[m.k])
        append_to_triangle(m.triangle, m.k, m.coefficient, sqrt(rest))
        fine = rest > 0.0
        m.k += 1
    m.k = count
    return fine


def finish(m):
    """Step 3: mu and s as functions of the active rows alone; False if these fail.

    Where no row has entered or left, step 1 has computed just that. A single solve goes
    without, as there is no other that its answer could differ from; so does one with
    many active rows, up to MOST_AGE times, with mu and s of the L at hand.
    """
    if m.changed and not m.is_single:
        if m.k <= MOST_SORTED or m.age > MOST_AGE:
            sort_active(m)
            if not factor_active(m):
                return False
            m.age = 0
        set_multipliers(m)
        set_point_values(m)
    m.changed = False
    return True
