"""The null-space form of `steps`, for dense QPs with most variables at bounds.

It takes the same steps, by the same rules and tolerances, but computes with the face of
the active rows: the variables F not at bounds (B: all others) and the *held* rows
C x = d, the equations and the active rows of G. Their multipliers r and x_F solve

    [P_FF  C_F'] [x_F]   [-q_F - P_FB x_B]
    [C_F   0   ] [ r ] = [d - C_B x_B    ]

by L L' = P_FF, T = C_F L'^-1 and R R' = T T'; the multipliers of the active bounds are
minus the gradient. An entering row c changes x_F by -t z and r by -t v, where z and v
solve the same system for (c_F, 0); the rest of the row orthogonal to the active ones is
c_F'z, and the multipliers of bounds change by -t (c - P z - C'v)_B. So a step costs
n nf operations instead of n k for k active rows, and bounds cost nothing: this pays
where nf and the held rows are fewer than k (`are_most_at_bounds`), for nf up to 2/3 n.

A variable that becomes free is appended to L; one that is fixed is removed by Givens
rotations. T and R are computed anew, as few rows are held. Where the factors do not
allow a face, as too many variables are free or rows depend on each other, the form with
responses has to solve the QP: code WIDE.
"""

import cython
from cython import Py_ssize_t
from cython.cimports.libc.math import INFINITY, isinf, sqrt
from cython.cimports.namlcp.linalg.dense import (
    append_to_triangle,
    remove_from_triangle,
    times_rows,
    triangle_solve,
    triangle_solve_transposed,
)
from cython.cimports.namlcp.linalg.vectors import add_scaled, copy, dot, fill
from cython.cimports.namlcp.qp.active.dense import DenseActiveSet, set_unit_load
from cython.cimports.namlcp.qp.active.judgement import judge, set_contradiction
from cython.cimports.namlcp.qp.active.rows import goal_of, is_pinned
from cython.cimports.namlcp.qp.active.run import is_faulty, solve_dense, sum_anew
from cython.cimports.namlcp.qp.active.state import (
    CONTRADICTION,
    DONE,
    FAULTY,
    LATE,
    STUCK,
    SUMMED,
    WIDE,
    indices,
    reals,
)
from cython.cimports.namlcp.qp.active.steps import (
    DEPENDENT,
    MOST_AGE,
    MOST_SORTED,
    VIOLATION_ROUNDING,
    excuse,
    has_next,
)
from cython.cimports.namlcp.watch import is_over

# Operations of a solve from which on it is left to the other form. LEAST_FREE: least
# variables for this form; with fewer it would gain nothing.
MOST_WORK = 5e7


class NullSpace(DenseActiveSet):
    """A dense QP of a sequence, with room for either form."""

    def lay_out(self):
        DenseActiveSet.lay_out(self)
        n, p, most = self.n, self.p, self.most
        count = min(2 * n // 3, most) if LEAST_FREE <= n <= most + p else 0
        triangle = count * (count + 1) // 2
        self.free, self.free_triangle = indices(self, count), reals(self, triangle)
        self.held_rows = reals(self, count * count)
        self.held_triangle = reals(self, triangle)
        self.free_part, self.held_part = reals(self, count), reals(self, count)
        self.load, self.row_multiplier = reals(self, n), reals(self, self.rows)
        self.row_ratio = reals(self, self.length)
        self.most_free, self.is_free, self.face_is_kept = count, False, False

    def set_values(self, rhs, values):
        """On the face: set the change of the point for its residuals, without G x."""
        if not self.on_face:
            DenseActiveSet.set_values(self, rhs, values)
            return
        set_free_part(self, rhs, self.free_part)
        copy(rhs + self.n, self.held_part, self.p)
        for i in range(self.held):
            row = self.active[i]
            self.held_part[self.p + i] = self.h[row] - self.s[row]
        fill(values, 0.0, self.rows)
        solve_face(self, values)
        fill(self.work, 0.0, self.k)
        copy(self.held_part + self.p, self.work, self.held)

    def times_cost(self, x, Px):
        """Set Px = P x; on the face, from the load of the active bounds."""
        if not self.on_face:
            DenseActiveSet.times_cost(self, x, Px)
            return
        copy(self.load, Px, self.n)
        for i in range(self.free_count):
            j = self.free[i]
            add_scaled(x[j], self.P + j * self.n, Px, self.n)


def solve_next(m):
    """Solve the next QP with the same matrices, on the face where that is smaller.

    Where that fails, the active rows of the last solved QP are a hint for the other
    form, which has no factor of theirs.
    """
    if m.is_free and m.is_ready and m.kept_k > 0 and m.hints == 0:
        found = solve_on_face(m)
        if found != WIDE and found != STUCK:
            return found
        m.hints, m.kept_k = m.kept_k, 0
    found = solve_dense(m)
    m.is_free = found == DONE and m.rho == 0.0 and are_most_at_bounds(m)
    m.face_is_kept = False
    return found


def solve_on_face(m):
    """Solve the QP from the active rows of the last one; WIDE, STUCK: it does not."""
    m.pivots, m.entering = 0, -1
    if is_faulty(m):
        return FAULTY
    found = find_face(m)
    list_active(m)
    if found == CONTRADICTION:
        set_contradiction(m)
    if found != DONE and found != LATE:
        return found
    m.on_face = True
    found = judge(m, found)
    m.on_face = False
    if found == SUMMED:
        found = sum_anew(m)
    m.face_is_kept = found == DONE
    return found


def find_face(m):
    """Find the face of the solution, and the point on it."""
    if not (recall_face(m) and leave_wrong_signs(m)):
        return WIDE
    m.level, m.base_size, counted = VIOLATION_ROUNDING, 0.0, 0.0
    while m.entering >= 0 or has_next(m):
        if is_over(m, m.operations - counted):
            return LATE
        counted = m.operations
        found = step_on_face(m)
        if found == CONTRADICTION:
            found = excuse(m)
            if found == DONE and not leave_wrong_signs(m):
                return WIDE
        if found != DONE:
            return found
    if m.entering >= 0:
        return WIDE
    if m.changed:  # step 3: the point as a function of the active rows alone
        is_anew: cython.bint = m.free_count <= MOST_SORTED or m.face_age > MOST_AGE
        if is_anew and not factor_face(m):
            return WIDE
        set_load(m)
        set_face_point(m)
    return DONE


def are_most_at_bounds(m):
    """Tell whether the form of the face is the smaller one: its order, see above."""
    count: Py_ssize_t = 0
    for i in range(m.k):
        count += m.active[i] >= m.m
    return m.most_free > 0 and m.n - count + m.p < count


# ---- the face


def held_row(m, i):
    """Return the coefficients of held row i: an equation, or a row of G."""
    return m.A + i * m.n if i < m.p else m.G + m.active[i - m.p] * m.n


def set_free_part(m, vector, out):
    """Set out to the entries of the free variables."""
    for i in range(m.free_count):
        out[i] = vector[m.free[i]]


def append_free(m, j):
    """Append variable j to L; tell whether there is room, and P allows it."""
    count, row, b = m.free_count, m.P + j * m.n, m.free_part
    if count == m.most_free:
        return False
    set_free_part(m, row, b)
    triangle_solve(m.free_triangle, count, b)
    rest = row[j] - dot(b, b, count)
    if not rest > 0.0:
        return False
    append_to_triangle(m.free_triangle, count, b, sqrt(rest))
    m.free[count] = j
    m.free_count += 1
    return True


def factor_held(m):
    """Compute T and R from L; tell whether the held rows are independent."""
    count, held, b = m.free_count, m.p + m.held, m.held_part
    if held > count:
        return False
    for i in range(held):
        t = m.held_rows + i * m.most_free
        set_free_part(m, held_row(m, i), t)
        triangle_solve(m.free_triangle, count, t)
        times_rows(m.held_rows, i, m.most_free, count, t, b)
        triangle_solve(m.held_triangle, i, b)
        rest = dot(t, t, count) - dot(b, b, i)
        if not rest > 0.0:
            return False
        append_to_triangle(m.held_triangle, i, b, sqrt(rest))
    return True


def factor_face(m):
    """Compute all factors from the sides of the rows, in sorted order."""
    m.free_count, m.held, m.face_age = 0, 0, 0
    for i in range(m.m):
        if m.side[i] != 0:
            m.active[m.held] = i
            m.held += 1
    for j in range(m.n):
        if m.side[m.m + j] == 0 and not append_free(m, j):
            return False
    return factor_held(m)


def factor_changed(m):
    """Compute T and R after a change of the face, unless there were too many."""
    m.changed, m.face_is_kept = True, False
    m.face_age += 1
    m.operations += (m.free_count + m.p + m.held + 2) * (m.length + m.n)  # about
    return m.operations <= MOST_WORK and factor_held(m)


def remove_index(order, count, index):
    """Remove an index from a list of `count`; return its place."""
    at: Py_ssize_t = 0
    while order[at] != index:
        at += 1
    for i in range(at, count - 1):
        order[i] = order[i + 1]
    return at


def leave(m, row):
    """Let an active row leave; False where the factors do not allow it."""
    m.side[row] = 0
    if row < m.m:
        remove_index(m.active, m.held, row)
        m.held -= 1
    elif append_free(m, row - m.m):
        add_scaled(-m.s[row], m.P + (row - m.m) * m.n, m.load, m.n)
    else:
        return False
    return factor_changed(m)


def enter(m, row, sign):
    """Let a row enter with the multiplier sign * m.own; False as for `leave`."""
    m.side[row], m.row_multiplier[row] = sign, sign * m.own
    if row < m.m:
        m.active[m.held] = row
        m.held += 1
    else:
        j = row - m.m
        at = remove_index(m.free, m.free_count, j)
        remove_from_triangle(m.free_triangle, m.free_count, at, m.cosines, m.sines)
        m.free_count -= 1
        m.s[row] = goal_of(m, row, sign)
        add_scaled(m.s[row], m.P + j * m.n, m.load, m.n)
    return factor_changed(m)


def solve_face(m, values):
    """Solve P_FF x + C_F' r = f, C_F x = g: f is in m.free_part, g in m.held_part.

    x and r take their places, and go to values = (G x, x, y), without G x. Returns the
    squared length of the part of L^-1 f orthogonal to T; 0.0 where it depends on T.
    """
    count, held, f, r = m.free_count, m.p + m.held, m.free_part, m.held_part
    triangle_solve(m.free_triangle, count, f)
    whole = dot(f, f, count)
    for i in range(held):
        r[i] = dot(m.held_rows + i * m.most_free, f, count) - r[i]
    triangle_solve(m.held_triangle, held, r)
    triangle_solve_transposed(m.held_triangle, held, r)
    for i in range(held):
        add_scaled(-r[i], m.held_rows + i * m.most_free, f, count)
    rest = dot(f, f, count)
    triangle_solve_transposed(m.free_triangle, count, f)
    for i in range(count):
        values[m.m + m.free[i]] = f[i]
    copy(r, values + m.rows, m.p)
    return rest if rest > DEPENDENT * whole else 0.0


def set_load(m):
    """Put the active bounds into x, and set the load P_B x_B."""
    fill(m.load, 0.0, m.n)
    for j in range(m.n):
        row = m.m + j
        if m.side[row] != 0:
            m.s[row] = goal_of(m, row, m.side[row])
            if m.s[row] != 0.0:
                add_scaled(m.s[row], m.P + j * m.n, m.load, m.n)


def set_face_point(m):
    """Set x_F and the multipliers of the held rows from the load."""
    x = m.s + m.m
    for i in range(m.free_count):
        j = m.free[i]
        m.free_part[i], x[j] = -m.q[j] - m.load[j], 0.0
    for i in range(m.p + m.held):
        goal = m.b[i] if i < m.p else m.h[m.active[i - m.p]]
        m.held_part[i] = goal - dot(held_row(m, i), x, m.n)
    solve_face(m, m.s)
    for i in range(m.held):
        m.row_multiplier[m.active[i]] = m.held_part[m.p + i]


def subtract_gradient(m, out):
    """Subtract P_F x + C'r, x in m.free_part and r in m.held_part."""
    for i in range(m.free_count):
        add_scaled(-m.free_part[i], m.P + m.free[i] * m.n, out, m.n)
    for i in range(m.p + m.held):
        add_scaled(-m.held_part[i], held_row(m, i), out, m.n)


# ---- the steps


def recall_face(m):
    """Go to the face of the last solved QP, less lost sides; tell whether it exists."""
    for i in range(m.k):
        m.side[m.active[i]] = 0
    m.changed, m.operations = False, 0.0
    for i in range(m.kept_k):
        if isinf(goal_of(m, m.kept_active[i], m.kept_side[i])):
            m.face_is_kept = False
        else:
            m.side[m.kept_active[i]] = m.kept_side[i]
    if not m.face_is_kept and not factor_face(m):
        return False
    set_load(m)
    return True


def leave_wrong_signs(m):
    """Step 1: let rows leave until all signs are right; False where that fails."""
    mu = m.row_multiplier
    while True:
        set_face_point(m)
        for j in range(m.n):
            mu[m.m + j] = -m.q[j] - m.load[j]
        subtract_gradient(m, mu + m.m)
        leaving: Py_ssize_t = -1
        least = 0.0
        for row in range(m.rows):
            signed = m.side[row] * mu[row]
            if signed < least and not is_pinned(m, row):
                leaving, least = row, signed
        if leaving < 0:
            break
        if not leave(m, leaving):
            return False
    times_rows(m.G, m.m, m.n, m.n, m.s + m.m, m.s)
    return True


def step_on_face(m):
    """Do what `step` does."""
    row, sign, mu, ratio = m.entering, m.entering_side, m.row_multiplier, m.row_ratio
    rest = set_direction(m, row)
    leaving: Py_ssize_t = -1
    t = INFINITY
    for i in range(m.rows):
        side = m.side[i]
        falls, signed = sign * side * ratio[i], side * mu[i]
        if falls > 0.0 and signed < t * falls and not is_pinned(m, i):
            leaving, t = i, signed / falls
    t = max(t, 0.0)
    if rest > 0.0:
        full = sign * (m.s[row] - goal_of(m, row, sign)) / rest
        if full <= t:
            leaving, t = -1, full
    elif leaving < 0:
        return CONTRADICTION
    add_scaled(-sign * t, m.direction, m.s, m.length)
    add_scaled(-sign * t, ratio, mu, m.rows)
    m.own += t
    if leaving >= 0:
        return DONE if leave(m, leaving) else WIDE
    m.entering = -1
    return DONE if enter(m, row, sign) else WIDE


def set_direction(m, row):
    """Set the change of the values and multipliers for the multiplier of a row.

    Returns the squared length of the row's part orthogonal to the active rows; 0.0,
    with no change of x, if it depends on them.
    """
    direction, ratio, scale = m.direction, m.row_ratio, m.scale[row]
    fill(ratio, 0.0, m.m)
    set_unit_load(m, row, ratio + m.m)
    set_free_part(m, ratio + m.m, m.free_part)
    fill(m.held_part, 0.0, m.p + m.held)
    fill(direction, 0.0, m.rows)
    rest = solve_face(m, direction)
    if not rest * scale * scale > m.least_curvature:
        rest = 0.0
        fill(m.free_part, 0.0, m.free_count)
        fill(direction, 0.0, m.rows)
    times_rows(m.G, m.m, m.n, m.n, direction + m.m, direction)
    subtract_gradient(m, ratio + m.m)
    for i in range(m.held):
        ratio[m.active[i]] = m.held_part[m.p + i]
    return rest


def list_active(m):
    """List the active rows and their multipliers as `judgement` expects them."""
    m.k = m.held
    for i in range(m.held):
        row = m.active[i]
        m.multiplier[i], m.ratio[i] = m.row_multiplier[row], m.row_ratio[row]
    for row in range(m.m, m.rows):
        if m.side[row] != 0:
            if is_pinned(m, row):
                m.side[row] = 1 if m.row_multiplier[row] >= 0.0 else -1
            m.active[m.k] = row
            m.k += 1
