"""The face of the active rows: its factors, and the systems they solve.

m.free are the free variables in the order of L, m.free_count of them; m.active begins
with the m.held active rows of G, and held row i is equation i or row m.active[i - p].
"""

import numpy as np

from namlcp.compiled import floats, longs, part
from namlcp.linalg import add_scaled, dot
from namlcp.qp.responses.dense import row_of
from namlcp.qp.responses.matrices import (
    append_to_triangle,
    remove_from_triangle,
    triangle_solve,
    triangle_solve_transposed,
)
from namlcp.qp.responses.rows import goal_of


@part
def triangle_at(m, address):
    """Return one of the triangles L and R."""
    return floats(address, m.most_free * (m.most_free + 1) // 2)


@part
def held_row(m, i):
    """Return the coefficients of held row i."""
    if i < m.p:
        return row_of(m.A, i, m.n)
    return row_of(m.G, longs(m.active, m.most + 1)[i - m.p], m.n)


@part
def divided_row(m, i):
    """Return row i of T: held row i, divided by L'."""
    return floats(m.held_rows + 8 * m.most_free * i, m.free_count)


@part
def set_free_part(m, vector, out):
    """Set out to the entries of the free variables."""
    free = longs(m.free, m.most_free)
    for i in range(m.free_count):
        out[i] = vector[free[i]]


# ---- factors


@part
def append_free(m, j):
    """Append variable j to L; tell whether P allows it."""
    count, L = m.free_count, triangle_at(m, m.free_triangle)
    row, b = row_of(m.P, j, m.n), floats(m.free_part, count)
    set_free_part(m, row, b)
    triangle_solve(L, count, b)
    rest = row[j] - dot(b, b)
    if not rest > 0.0:
        return False
    append_to_triangle(L, count, b, np.sqrt(rest))
    longs(m.free, m.most_free)[count] = j
    m.free_count += 1
    return True


@part
def factor_held(m):
    """Compute T and R from L; tell whether the held rows are independent."""
    count, held = m.free_count, m.p + m.held
    if held > count:
        return False
    L, R = triangle_at(m, m.free_triangle), triangle_at(m, m.held_triangle)
    b = floats(m.held_part, held)
    for i in range(held):
        t = divided_row(m, i)
        set_free_part(m, held_row(m, i), t)
        triangle_solve(L, count, t)
        for j in range(i):
            b[j] = dot(divided_row(m, j), t)
        triangle_solve(R, i, b)
        rest = dot(t, t) - dot(b[:i], b[:i])
        if not rest > 0.0:
            return False
        append_to_triangle(R, i, b, np.sqrt(rest))
    return True


@part
def factor_face(m):
    """Compute all factors from the sides of the rows, in sorted order.

    False where there are too many free variables, or rows depend on each other.
    """
    side, active = longs(m.side, m.rows), longs(m.active, m.most + 1)
    m.free_count, m.held, m.face_age = 0, 0, 0
    for j in range(m.n):
        if side[m.m + j] == 0 and (
            m.free_count == m.most_free or not append_free(m, j)
        ):
            return False
    for i in range(m.m):
        if side[i] != 0:
            if m.p + m.held >= m.free_count:
                return False
            active[m.held] = i
            m.held += 1
    return factor_held(m)


# ---- changes of the face, after which `factor_held` has to be called


@part
def note_change(m):
    """Note that the face is no longer that of the last solved QP."""
    m.changed, m.face_is_kept = 1, 0
    m.face_age += 1


@part
def free_variable(m, j):
    """Let variable j leave its bound; tell whether there is room, and P allows it."""
    if m.free_count == m.most_free or not append_free(m, j):
        return False
    note_change(m)
    longs(m.side, m.rows)[m.m + j] = 0
    x = floats(m.s + 8 * m.m, m.n)
    add_scaled(-x[j], row_of(m.P, j, m.n), floats(m.load, m.n))
    return True


@part
def fix_variable(m, j, at):
    """Put variable j on its bound of side `at`."""
    note_change(m)
    free, i = longs(m.free, m.most_free), 0
    while free[i] != j:
        i += 1
    remove_from_triangle(
        triangle_at(m, m.free_triangle),
        m.free_count,
        i,
        floats(m.cosines, m.most),
        floats(m.sines, m.most),
    )
    m.free_count -= 1
    for k in range(i, m.free_count):
        free[k] = free[k + 1]
    longs(m.side, m.rows)[m.m + j] = at
    x = floats(m.s + 8 * m.m, m.n)
    x[j] = goal_of(m, m.m + j, at)
    add_scaled(x[j], row_of(m.P, j, m.n), floats(m.load, m.n))


@part
def hold_row(m, row, multiplier):
    """Make a row of G active; tell whether there is room for it."""
    if m.p + m.held == m.free_count:
        return False
    note_change(m)
    longs(m.active, m.most + 1)[m.held] = row
    floats(m.multiplier, m.most + 1)[m.held] = multiplier
    longs(m.side, m.rows)[row] = 1
    m.held += 1
    return True


@part
def release_row(m, i):
    """Let row m.active[i] of G leave."""
    note_change(m)
    active, multiplier = longs(m.active, m.most + 1), floats(m.multiplier, m.most + 1)
    longs(m.side, m.rows)[active[i]] = 0
    m.held -= 1
    for k in range(i, m.held):
        active[k], multiplier[k] = active[k + 1], multiplier[k + 1]


# ---- solves


@part
def solve_face(m, f, r):
    """Solve P_FF x + C_F' r = f, C_F x = g: x comes in f, and r in place of g.

    Returns the squared lengths of L^-1 f and of its part orthogonal to T, x'P_FF x.
    """
    count, held = m.free_count, m.p + m.held
    L, R = triangle_at(m, m.free_triangle), triangle_at(m, m.held_triangle)
    triangle_solve(L, count, f)
    whole = dot(f, f)
    for i in range(held):
        r[i] = dot(divided_row(m, i), f) - r[i]
    triangle_solve(R, held, r)
    triangle_solve_transposed(R, held, r)
    for i in range(held):
        add_scaled(-r[i], divided_row(m, i), f)
    rest = dot(f, f)
    triangle_solve_transposed(L, count, f)
    return whole, rest


@part
def set_load(m):
    """Put the active bounds into x, and set the load P_B x_B."""
    side, load = longs(m.side, m.rows), floats(m.load, m.n)
    x = floats(m.s + 8 * m.m, m.n)
    for j in range(m.n):
        load[j] = 0.0
    for j in range(m.n):
        if side[m.m + j] != 0:
            x[j] = goal_of(m, m.m + j, side[m.m + j])
            if x[j] != 0.0:
                add_scaled(x[j], row_of(m.P, j, m.n), load)


@part
def set_face_point(m):
    """Set x_F and the multipliers of the held rows from the load."""
    free, active = longs(m.free, m.most_free), longs(m.active, m.most + 1)
    f, r = floats(m.free_part, m.free_count), floats(m.held_part, m.p + m.held)
    q, b, h = floats(m.q, m.n), floats(m.b, m.p), floats(m.h, m.m)
    x, y = floats(m.s + 8 * m.m, m.n), floats(m.s + 8 * m.rows, m.p)
    load = floats(m.load, m.n)
    for i in range(m.free_count):
        f[i] = -q[free[i]] - load[free[i]]
        x[free[i]] = 0.0
    for i in range(m.p + m.held):
        goal = b[i] if i < m.p else h[active[i - m.p]]
        r[i] = goal - dot(held_row(m, i), x)
    solve_face(m, f, r)
    multiplier = floats(m.multiplier, m.most + 1)
    for i in range(m.free_count):
        x[free[i]] = f[i]
    for i in range(m.p):
        y[i] = r[i]
    for i in range(m.held):
        multiplier[i] = r[m.p + i]


@part
def add_free_columns(m, scale, f, out):
    """Add scale * P_F f to out."""
    free = longs(m.free, m.most_free)
    for i in range(m.free_count):
        add_scaled(scale * f[i], row_of(m.P, free[i], m.n), out)


@part
def set_bound_multipliers(m):
    """Set the multipliers of the active bounds to minus the gradient."""
    q, load = floats(m.q, m.n), floats(m.load, m.n)
    y = floats(m.s + 8 * m.rows, m.p)
    multiplier, bound = (
        floats(m.multiplier, m.most + 1),
        floats(m.bound_multiplier, m.n),
    )
    for j in range(m.n):
        bound[j] = -q[j] - load[j]
    f = floats(m.free_part, m.free_count)
    set_free_part(m, floats(m.s + 8 * m.m, m.n), f)
    add_free_columns(m, -1.0, f, bound)
    for i in range(m.p + m.held):
        r = y[i] if i < m.p else multiplier[i - m.p]
        add_scaled(-r, held_row(m, i), bound)
