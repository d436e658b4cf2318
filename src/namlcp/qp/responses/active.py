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

How a base problem is solved and a response made is not known here: where `pivot` or
`admit_hints` need a response, they return RESPONSE with the row in m.asked, and are
called again once it is there.
"""

import numpy as np

from namlcp.compiled import floats, longs, part
from namlcp.limits import is_over
from namlcp.linalg import add_scaled, dot
from namlcp.options import DEFAULT_OPTIONS
from namlcp.qp.responses.matrices import (
    append_to_triangle,
    remove_from_triangle,
    triangle_solve,
    triangle_solve_transposed,
)
from namlcp.qp.responses.rows import (
    goal_of,
    has_response,
    is_pinned,
    response_of,
    solve_active,
    subtract_responses,
)

# What the parts return. RESPONSE: see above. LATE: the time limit, Ctrl-C. STUCK: the
# method gives up, another one has to solve the QP.
DONE, RESPONSE, CONTRADICTION, LATE, STUCK = range(5)

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
# Pivots at most, per row and variable; another method is safer for a QP that needs
# more. A limit of USUAL is not the user's choice, and is exceeded up to GROWN per row
# and variable; see also m.most_operations.
MOST_PIVOTS, USUAL, GROWN = 10, DEFAULT_OPTIONS.max_iter, 3

# Most active rows for which L is always computed anew at the end, which takes k^3 / 6
# operations, and most changes of a larger L before it is.
MOST_SORTED, MOST_AGE = 64, 50


@part
def remove_row(m, i):
    """Remove the active row number i."""
    active = longs(m.active, m.most + 1)
    multiplier = floats(m.multiplier, m.most + 1)
    longs(m.side, m.rows)[active[i]] = 0
    remove_from_triangle(
        floats(m.triangle, m.most * (m.most + 1) // 2),
        m.k,
        i,
        floats(m.cosines, m.most),
        floats(m.sines, m.most),
    )
    for j in range(i, m.k - 1):
        active[j], multiplier[j] = active[j + 1], multiplier[j + 1]
    m.k -= 1
    m.changed = 1
    m.age += 1


@part
def append_row(m, row, side, multiplier, length):
    """Make a row active; m.coefficient = L^-1 w_F, `length` the new entry of L."""
    k = m.k
    append_to_triangle(
        floats(m.triangle, m.most * (m.most + 1) // 2),
        k,
        floats(m.coefficient, m.most + 1),
        length,
    )
    longs(m.active, m.most + 1)[k] = row
    longs(m.side, m.rows)[row] = side
    floats(m.multiplier, m.most + 1)[k] = multiplier
    m.k = k + 1
    m.changed = 1
    m.age += 1


@part
def rest_of(m, row):
    """Return the squared length of w_row orthogonal to the active rows.

    Sets m.coefficient = L^-1 w_F; negative or 0 where rounding is all that is left.
    """
    k = m.k
    w = response_of(m, row)
    active = longs(m.active, m.most + 1)
    coefficient = floats(m.coefficient, m.most + 1)[:k]
    for i in range(k):
        coefficient[i] = w[active[i]]
    triangle_solve(floats(m.triangle, m.most * (m.most + 1) // 2), k, coefficient)
    return w[row] - dot(coefficient, coefficient)


@part
def is_dependent(m, row, rest, limit):
    """Tell whether a row with this `rest_of` depends on equations and active rows."""
    scale = floats(m.scale, m.rows)[row]
    whole = response_of(m, row)[row]
    if m.k == m.most or m.k >= most_independent(m):
        return True
    return not (rest > limit * whole and rest * scale * scale > m.least_curvature)


@part
def most_independent(m):
    """Return how many rows may be active, for the rank of the equations."""
    return m.n - m.p + m.skipped


# ---- step 1


@part
def recall(m):
    """Make the rows active that were so in the last solved QP, less lost sides."""
    active, side = longs(m.active, m.most + 1), longs(m.side, m.rows)
    kept, kept_side = longs(m.kept_active, m.most + 1), longs(m.kept_side, m.most + 1)
    for i in range(m.k):
        side[active[i]] = 0
    m.k, m.changed, m.operations = m.kept_k, 0, 0.0
    m.age = m.kept_age if m.k > 0 else 0
    for i in range(m.k):
        active[i] = kept[i]
        side[kept[i]] = kept_side[i]
    size = m.most * (m.most + 1) // 2
    triangle, kept_triangle = floats(m.triangle, size), floats(m.kept_triangle, size)
    for i in range(m.k * (m.k + 1) // 2):
        triangle[i] = kept_triangle[i]
    for i in range(m.k - 1, -1, -1):
        if np.isinf(goal_of(m, active[i], side[active[i]])):
            remove_row(m, i)


@part
def keep(m):
    """Note the active rows as those of the last solved QP."""
    active, side = longs(m.active, m.most + 1), longs(m.side, m.rows)
    kept, kept_side = longs(m.kept_active, m.most + 1), longs(m.kept_side, m.most + 1)
    for i in range(m.k):
        kept[i], kept_side[i] = active[i], side[active[i]]
    m.kept_k, m.kept_age = m.k, m.age
    m.triangle, m.kept_triangle = m.kept_triangle, m.triangle


@part
def admit_hints(m):
    """Append the rows of the hint that are independent: DONE or RESPONSE.

    The hint is in the kept rows from m.hinted to m.hints.
    """
    kept, kept_side = longs(m.kept_active, m.most + 1), longs(m.kept_side, m.most + 1)
    while m.hinted < m.hints:
        row, side = kept[m.hinted], kept_side[m.hinted]
        is_new = longs(m.side, m.rows)[row] == 0
        if is_new and m.k < m.most and not np.isinf(goal_of(m, row, side)):
            if not has_response(m, row):
                m.asked = row
                return RESPONSE
            rest = rest_of(m, row)
            if not is_dependent(m, row, rest, DEPENDENT_HINT):
                append_row(m, row, side, 0.0, np.sqrt(rest))
        m.hinted += 1
    return DONE


@part
def set_multipliers(m):
    """Set mu = S^-1 (s0_F - d_F)."""
    active, side = longs(m.active, m.most + 1), longs(m.side, m.rows)
    multiplier = floats(m.multiplier, m.most + 1)
    s0 = floats(m.s0, m.length)
    for i in range(m.k):
        row = active[i]
        multiplier[i] = s0[row] - goal_of(m, row, side[row])
    solve_active(m, multiplier)
    for i in range(m.k):
        if is_pinned(m, active[i]):
            side[active[i]] = 1 if multiplier[i] >= 0.0 else -1


@part
def set_values(m):
    """Set s = s0 - sum mu_i w_i."""
    s0, s = floats(m.s0, m.length), floats(m.s, m.length)
    for i in range(m.length):
        s[i] = s0[i]
    subtract_responses(m, floats(m.multiplier, m.most + 1), m.k, s)


@part
def drop_wrong_signs(m):
    """Step 1: remove active rows until all multipliers have the sign of their side."""
    active, side = longs(m.active, m.most + 1), longs(m.side, m.rows)
    multiplier = floats(m.multiplier, m.most + 1)
    while True:
        set_multipliers(m)
        leaving, least = -1, 0.0
        for i in range(m.k):
            signed = side[active[i]] * multiplier[i]
            if signed < least:
                leaving, least = i, signed
        if leaving < 0:
            break
        remove_row(m, leaving)
    set_values(m)


# ---- step 2


@part
def size_of(m, values):
    """Return the largest |x_j| over the norm of its row, for values (G x, x, ...)."""
    scale, size = floats(m.scale, m.rows), 0.0
    for i in range(m.m, m.rows):
        size = max(size, abs(values[i]) * scale[i])
    return size


@part
def choose_entering(m):
    """Set m.entering and its side: the row violated most for its norm, -1 for none."""
    s = floats(m.s, m.length)
    scale, h = floats(m.scale, m.rows), floats(m.h, m.m)
    lb, ub, x = floats(m.lb, m.n), floats(m.ub, m.n), s[m.m :]
    unit = scale[m.m :]
    size = size_of(m, s)
    level, rounding = m.level, m.level * size
    entering, worst, at_upper = -1, 0.0, 1
    for i in range(m.m):
        violation = (s[i] - h[i]) * scale[i]
        if violation > worst:
            if violation > level * abs(h[i]) * scale[i] + rounding:
                entering, worst = i, violation
    for j in range(m.n):
        violation = (x[j] - ub[j]) * unit[j]
        if violation > worst:
            if violation > level * abs(ub[j]) * unit[j] + rounding:
                entering, worst, at_upper = m.m + j, violation, 1
        violation = (lb[j] - x[j]) * unit[j]
        if violation > worst:
            if violation > level * abs(lb[j]) * unit[j] + rounding:
                entering, worst, at_upper = m.m + j, violation, -1
    m.entering, m.entering_side, m.own = entering, at_upper, 0.0


@part
def step(m):
    """Let the multiplier of the entering row grow until a step ends: DONE if it can.

    After a full step m.entering = -1.
    """
    row, sign, k = m.entering, m.entering_side, m.k
    active, side = longs(m.active, m.most + 1), longs(m.side, m.rows)
    multiplier = floats(m.multiplier, m.most + 1)
    ratio = floats(m.ratio, m.most + 1)
    coefficient = floats(m.coefficient, m.most + 1)
    rest = rest_of(m, row)
    dependent = is_dependent(m, row, rest, DEPENDENT)
    for i in range(k):
        ratio[i] = coefficient[i]
    triangle_solve_transposed(floats(m.triangle, m.most * (m.most + 1) // 2), k, ratio)
    leaving, t = -1, np.inf
    for i in range(k):
        falls = sign * side[active[i]] * ratio[i]
        signed = side[active[i]] * multiplier[i]
        if falls > 0.0 and signed < t * falls and not is_pinned(m, active[i]):
            leaving, t = i, signed / falls
    t = max(t, 0.0)
    s = floats(m.s, m.length)
    if leaving < 0 or not dependent:
        direction, w = floats(m.direction, m.length), response_of(m, row)
        for i in range(m.length):
            direction[i] = w[i]
        subtract_responses(m, ratio, k, direction)
    if not dependent:
        full = sign * (s[row] - goal_of(m, row, sign)) / rest
        if full <= t:
            leaving, t = -1, full
        add_scaled(-sign * t, floats(m.direction, m.length), s)
    elif leaving < 0:
        return CONTRADICTION
    for i in range(k):
        multiplier[i] -= sign * t * ratio[i]
    m.own += t
    if leaving >= 0:
        remove_row(m, leaving)
    else:
        append_row(m, row, sign, sign * m.own, np.sqrt(rest))
        m.entering = -1
    return DONE


@part
def is_noise(m):
    """Tell whether the violation of the entering row may be due to rounding errors."""
    row, s = m.entering, floats(m.s, m.length)
    goal, scale = goal_of(m, row, m.entering_side), floats(m.scale, m.rows)[row]
    terms = abs(goal) * scale + size_of(m, s)
    return abs(s[row] - goal) * scale <= NOISE * m.level * terms


@part
def has_next(m):
    """Choose the entering row, unless there is none or there were too many."""
    choose_entering(m)
    if m.entering < 0:
        return False
    m.pivots += 1
    most = max(USUAL, GROWN * m.rows) if m.max_iter == USUAL else m.max_iter
    return m.pivots <= min(most, MOST_PIVOTS * (m.rows + 1))


@part
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


@part
def pivot(m):
    """Step 2, as often as a row is violated: DONE, or see the codes above."""
    watch = longs(m.watch, 3)
    while True:
        if m.entering < 0:
            if not has_next(m):
                return DONE if m.entering < 0 else STUCK
            if not has_response(m, m.entering):
                m.asked = m.entering
                return RESPONSE
        operations = (m.k + 2) * (m.length + m.k)
        if is_over(watch, operations):
            return LATE
        m.operations += operations
        is_full = m.k == m.most and m.k < min(most_independent(m), m.rows)
        if is_full or m.operations > m.most_operations:
            return STUCK
        if step(m) == CONTRADICTION:
            found = excuse(m)
            if found != DONE:
                return found
            drop_wrong_signs(m)  # without the partial steps towards this row


# ---- step 3


@part
def sort_active(m):
    """Sort the active rows."""
    active = longs(m.active, m.most + 1)
    for i in range(1, m.k):
        row = active[i]
        j = i
        while j > 0 and active[j - 1] > row:
            active[j] = active[j - 1]
            j -= 1
        active[j] = row


@part
def factor_active(m):
    """Compute L from the responses; tell whether all rows are independent."""
    active = longs(m.active, m.most + 1)
    coefficient = floats(m.coefficient, m.most + 1)
    triangle = floats(m.triangle, m.most * (m.most + 1) // 2)
    k = m.k
    for i in range(k):
        w = response_of(m, active[i])
        for j in range(i):
            coefficient[j] = w[active[j]]
        triangle_solve(triangle, i, coefficient)
        rest = w[active[i]] - dot(coefficient[:i], coefficient[:i])
        if not rest > 0.0:
            return False
        append_to_triangle(triangle, i, coefficient, np.sqrt(rest))
    return True


@part
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
        set_values(m)
    m.changed = 0
    return True
