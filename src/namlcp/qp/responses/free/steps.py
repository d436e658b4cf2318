"""The steps of the dual active-set method on the face: see `active` for each of them.

Where the factors do not allow a face, as too many variables are free or rows depend on
each other, the form with responses has to solve the QP: code WIDE.
"""

import numpy as np

from namlcp.compiled import floats, longs, part
from namlcp.limits import is_over
from namlcp.linalg import add_scaled, dot
from namlcp.qp.responses.active import (
    CONTRADICTION,
    DEPENDENT,
    DONE,
    LATE,
    MOST_AGE,
    MOST_SORTED,
    STUCK,
    has_next,
)
from namlcp.qp.responses.dense import row_of
from namlcp.qp.responses.free.face import (
    add_free_columns,
    factor_face,
    factor_held,
    fix_variable,
    free_variable,
    held_row,
    hold_row,
    release_row,
    set_bound_multipliers,
    set_face_point,
    set_free_part,
    set_load,
    solve_face,
)
from namlcp.qp.responses.rows import goal_of, is_pinned

# A further code, see above.
WIDE = 7
# Operations of a solve from which on it is left to the other form. So few take less
# time than `limits.UNCHECKED_TIME`: solves without a time limit need no watch.
MOST_WORK = 5e7


@part
def recall_face(m):
    """Go to the face of the last solved QP, less lost sides; tell whether it exists."""
    kept, kept_side = longs(m.kept_active, m.most + 1), longs(m.kept_side, m.most + 1)
    clear_sides(m)
    m.changed, m.operations = 0, 0.0
    side, is_lost = longs(m.side, m.rows), False
    for i in range(m.kept_k):
        if np.isinf(goal_of(m, kept[i], kept_side[i])):
            is_lost = True
        else:
            side[kept[i]] = kept_side[i]
    if is_lost or not m.face_is_kept:
        m.face_is_kept = 0
        if not factor_face(m):
            return False
    set_load(m)
    return True


@part
def clear_sides(m):
    """Let no row be active, in whatever form."""
    side = longs(m.side, m.rows)
    for row in range(m.rows):
        side[row] = 0
    m.k = 0


@part
def list_active(m):
    """Append the active bounds to the active rows of G, as `judgement` expects them.

    The side of a pinned variable is that of its multiplier.
    """
    active, side = longs(m.active, m.most + 1), longs(m.side, m.rows)
    bound = floats(m.bound_multiplier, m.n)
    m.k = m.held
    for row in range(m.m, m.rows):
        if side[row] != 0:
            if is_pinned(m, row):
                side[row] = 1 if bound[row - m.m] >= 0.0 else -1
            active[m.k] = row
            m.k += 1


@part
def add_work(m):
    """Count the operations of a step, about."""
    m.operations += (m.free_count + m.p + m.held + 2) * (m.length + m.n)


@part
def leave_wrong_signs(m):
    """Step 1: let rows leave until all multipliers have the sign of their side.

    False where the factors do not allow it, or after too much work.
    """
    side, multiplier = longs(m.side, m.rows), floats(m.multiplier, m.most + 1)
    bound = floats(m.bound_multiplier, m.n)
    while True:
        set_face_point(m)
        set_bound_multipliers(m)
        leaving, least = -1, 0.0
        for i in range(m.held):
            if multiplier[i] < least:
                leaving, least = i, multiplier[i]
        for j in range(m.n):
            signed = side[m.m + j] * bound[j]
            if signed < least and not is_pinned(m, m.m + j):
                leaving, least = m.held + j, signed
        if leaving < 0:
            break
        add_work(m)
        if m.operations > MOST_WORK or not (leave(m, leaving) and factor_held(m)):
            return False
    set_row_values(m)
    return True


@part
def leave(m, leaving):
    """Let active row i of G, or the bound of variable leaving - m.held, leave."""
    if leaving >= m.held:
        return free_variable(m, leaving - m.held)
    release_row(m, leaving)
    return True


@part
def enter(m, row, sign):
    """Make the row active whose multiplier is sign * m.own."""
    if row < m.m:
        return hold_row(m, row, m.own)
    floats(m.bound_multiplier, m.n)[row - m.m] = sign * m.own
    fix_variable(m, row - m.m, sign)
    return True


@part
def set_row_values(m):
    """Set the values of the rows of G."""
    Gx, x = floats(m.s, m.m), floats(m.s + 8 * m.m, m.n)
    for i in range(m.m):
        Gx[i] = dot(row_of(m.G, i, m.n), x)


@part
def set_direction(m, row):
    """Set the change of the values and multipliers for the multiplier of a row.

    Returns the squared length of the row's part orthogonal to the active rows; 0.0,
    with no change of x, if it depends on them.
    """
    n, p = m.n, m.p
    free = longs(m.free, m.most_free)
    z, r = floats(m.free_part, m.free_count), floats(m.held_part, p + m.held)
    direction, bound_ratio = floats(m.direction, m.length), floats(m.bound_ratio, n)
    for j in range(n):
        bound_ratio[j] = row_of(m.G, row, n)[j] if row < m.m else 0.0
    if row >= m.m:
        bound_ratio[row - m.m] = 1.0
    for i in range(p + m.held):
        r[i] = 0.0
    set_free_part(m, bound_ratio, z)
    whole, rest = solve_face(m, z, r)
    scale = floats(m.scale, m.rows)[row]
    if not (rest > DEPENDENT * whole and rest * scale * scale > m.least_curvature):
        rest = 0.0
    for i in range(m.rows):
        direction[i] = 0.0
    if rest > 0.0:
        add_free_columns(m, -1.0, z, bound_ratio)
        for i in range(m.free_count):
            direction[m.m + free[i]] = z[i]
        for i in range(m.m):
            direction[i] = dot(row_of(m.G, i, n), floats(m.direction + 8 * m.m, n))
    for i in range(p + m.held):
        add_scaled(-r[i], held_row(m, i), bound_ratio)
    for i in range(p):
        direction[m.rows + i] = r[i]
    ratio = floats(m.ratio, m.most + 1)
    for i in range(m.held):
        ratio[i] = r[p + i]
    return rest


@part
def step_on_face(m):
    """Let the multiplier of the entering row grow until a step ends.

    After a full step m.entering = -1.
    """
    row, sign = m.entering, m.entering_side
    rest = set_direction(m, row)
    side, s = longs(m.side, m.rows), floats(m.s, m.length)
    multiplier, ratio = floats(m.multiplier, m.held), floats(m.ratio, m.held)
    bound, bound_ratio = floats(m.bound_multiplier, m.n), floats(m.bound_ratio, m.n)
    leaving, t = -1, np.inf
    for i in range(m.held):
        falls = sign * ratio[i]
        if falls > 0.0 and multiplier[i] < t * falls:
            leaving, t = i, multiplier[i] / falls
    for j in range(m.n):
        at = side[m.m + j]
        falls, signed = sign * at * bound_ratio[j], at * bound[j]
        if falls > 0.0 and signed < t * falls and not is_pinned(m, m.m + j):
            leaving, t = m.held + j, signed / falls
    t = max(t, 0.0)
    if rest > 0.0:
        full = sign * (s[row] - goal_of(m, row, sign)) / rest
        if full <= t:
            leaving, t = -1, full
    elif leaving < 0:
        return CONTRADICTION
    add_scaled(-sign * t, floats(m.direction, m.length), s)
    add_scaled(-sign * t, ratio, multiplier)
    for j in range(m.n):
        if side[m.m + j] != 0:
            bound[j] -= sign * t * bound_ratio[j]
    m.own += t
    if leaving >= 0:
        fits = leave(m, leaving)
    else:
        fits = enter(m, row, sign)
        m.entering = -1
    return DONE if fits and factor_held(m) else WIDE


@part
def pivot_on_face(m):
    """Step 2, as often as a row is violated."""
    watch = longs(m.watch, 3)
    while True:
        if m.entering < 0 and not has_next(m):
            return DONE if m.entering < 0 else STUCK
        before = m.operations
        add_work(m)
        if is_over(watch, m.operations - before):
            return LATE
        if m.operations > MOST_WORK:
            return WIDE
        found = step_on_face(m)
        if found != DONE:
            return found


@part
def finish_on_face(m):
    """Step 3: the point as a function of the active rows alone; False if it fails."""
    if m.changed:
        is_anew = m.free_count <= MOST_SORTED or m.face_age > MOST_AGE
        if is_anew and not factor_face(m):
            return False
        set_load(m)
        set_face_point(m)
    return True


@part
def correct_on_face(m):
    """Add a correction to the point: m.rhs and s as `set_correction` leaves them."""
    free, active = longs(m.free, m.most_free), longs(m.active, m.most + 1)
    f, r = floats(m.free_part, m.free_count), floats(m.held_part, m.p + m.held)
    rhs, s, h = floats(m.rhs, m.n + m.p), floats(m.s, m.length), floats(m.h, m.m)
    multiplier = floats(m.multiplier, m.most + 1)
    set_free_part(m, rhs, f)
    for i in range(m.p):
        r[i] = rhs[m.n + i]
    for i in range(m.held):
        r[m.p + i] = h[active[i]] - s[active[i]]
    solve_face(m, f, r)
    for i in range(m.free_count):
        s[m.m + free[i]] += f[i]
    for i in range(m.p):
        s[m.rows + i] += r[i]
    for i in range(m.held):
        multiplier[i] += r[m.p + i]
