"""The active rows of a face: where they come from, and which the next face has."""

import numpy as np

from namlcp.compiled import floats, floats_at, longs_at, part
from namlcp.qp.responses.faces.system import (
    GAIN,
    MOST_SOLVES,
    correct,
    is_accurate,
    set_products,
    set_rest,
)
from namlcp.qp.responses.judgement import measure_result, parts_of_result
from namlcp.qp.responses.rows import goal_of, is_pinned

# Violations of a side or a sign over the terms of its row that count as rounding: in
# the choice of the next face, and where all of them together let a face be the last.
ROUNDING, NEGLIGIBLE = 1e-12, 1e-11
# A face is left before its system is solved to the end where the violation is so many
# times the residual.
CLEAR = 1e4


@part
def recall(m):
    """Begin with the active rows of the last solved QP, less those without a side."""
    side, kept_side = longs_at(m.side, m.rows), longs_at(m.kept_side, m.rows)
    for i in range(m.rows):
        side[i] = kept_side[i]
        if side[i] != 0 and np.isinf(goal_of(m, i, side[i])):
            side[i] = 0
    begin_face(m)


@part
def begin_face(m):
    """Begin to solve a face's system: at the last solved point, with what is held.

    The point of the face before may be far away, in directions that only the shift
    bounds and this face leaves open.
    """
    u, kept = floats_at(m.u, m.size), floats_at(m.kept_u, m.size)
    side = longs_at(m.side, m.rows)
    for j in range(m.size):
        u[j] = kept[j]
    for i in range(m.rows):
        if i < m.m and side[i] == 0:
            u[m.n + m.p + i] = 0.0
        elif i >= m.m and side[i] != 0:
            u[i - m.m] = goal_of(m, i, side[i])


@part
def find_point(m):
    """Solve the system of the face, and choose the next face by the signs.

    Ends early where these are clearly wrong.
    """
    before = np.inf
    for solves in range(MOST_SOLVES + 1):
        set_products(m)
        error = set_rest(m)
        if solves > 0 and not error < before:
            m.u, m.best_u = m.best_u, m.u
            set_products(m)
            break
        if is_accurate(m, error) or error > GAIN * before or solves == MOST_SOLVES:
            break
        if solves > 0:
            choose_next(m)
            if m.violation > CLEAR * error:
                return
        correct(m)
        before = error
    choose_next(m)


@part
def choose_next(m):
    """Choose the sides of the next face, and note the largest violation of this one.

    Rows with a violation above ROUNDING change; a row with two equal sides stays
    active.
    """
    u, unit = floats_at(m.u, m.size), floats_at(m.unit, m.size)
    side = longs_at(m.side, m.rows)
    q, h = floats_at(m.q, m.n), floats_at(m.h, m.m)
    lb, ub = floats_at(m.lb, m.n), floats_at(m.ub, m.n)
    Px, Aty, Gtz = floats_at(m.Px, m.n), floats_at(m.Aty, m.n), floats_at(m.Gtz, m.n)
    Gx = floats_at(m.Gx, m.m)
    m.violation = 0.0
    for i in range(m.m):
        at = m.n + m.p + i
        if side[i] != 0:
            excess = -u[at] / (unit[at] * m.dual_size)
        else:
            excess = (Gx[i] - h[i]) * unit[at] / m.primal_size
        note_change(m, i, 1, excess)
    for j in range(m.n):
        i, entering = m.m + j, 1
        if side[i] != 0:
            gradient = Px[j] + q[j] + Gtz[j] + Aty[j]
            if is_pinned(m, i):
                side[i] = 1 if gradient <= 0.0 else -1
                gradient = 0.0
            excess = side[i] * gradient * unit[j] / m.dual_size
        else:
            below = lb[j] - u[j]
            excess = u[j] - ub[j]
            if below > excess:
                entering, excess = -1, below
            excess /= unit[j] * m.primal_size
        note_change(m, i, entering, excess)


@part
def note_change(m, i, entering, excess):
    """Set the next side of row i, violated by `excess`: `entering`, or none."""
    side, following = longs_at(m.side, m.rows), longs_at(m.next_side, m.rows)
    following[i] = side[i]
    if excess > ROUNDING:
        following[i] = entering if side[i] == 0 else 0
        m.violation = max(m.violation, excess)


@part
def go_on(m):
    """Go to the next face; False if this is the last one."""
    if m.violation <= NEGLIGIBLE:
        return False
    m.side, m.next_side = m.next_side, m.side
    begin_face(m)
    return True


@part
def set_result(m):
    """Set the result of the last face, and its residuals on the data as given."""
    n, rows = m.n, m.n + m.p
    u, side = floats_at(m.u, m.size), longs_at(m.side, m.rows)
    for i in range(m.m):
        u[rows + i] = max(u[rows + i], 0.0)
    set_products(m)
    q, Px = floats(m.q, n), floats(m.Px, n)
    Aty, Gtz = floats(m.Aty, n), floats(m.Gtz, n)
    x, y, z, z_box = parts_of_result(m)
    for j in range(n):
        x[j], z_box[j] = u[j], 0.0
        sign = side[m.m + j]
        if sign != 0:
            gradient = Px[j] + q[j] + Gtz[j] + Aty[j]
            z_box[j] = sign * max(-sign * gradient, 0.0)
    for i in range(m.p):
        y[i] = u[n + i]
    for i in range(m.m):
        z[i] = u[rows + i]
    measure_result(m)


@part
def keep(m):
    """Note the point and its face as those of the last solved QP."""
    m.u, m.kept_u = m.kept_u, m.u
    m.side, m.kept_side = m.kept_side, m.side
