"""The null-space form of `engine`, for dense QPs with most variables at bounds.

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
where nf and the held rows are fewer than k, for nf up to 2/3 n.

A variable that becomes free is appended to L; one that is fixed is removed by Givens
rotations. T and R are computed anew, as few rows are held. Where the factors do not
allow a face, as too many variables are free or rows depend on each other, the form with
responses has to solve the QP: code STUCK.
"""

import cython
from cython import Py_ssize_t
from cython.cimports.libc.math import isinf, sqrt

# LEAST_FREE: least variables for which this form gains anything.


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
        self.load, self.slope = reals(self, n), reals(self, n + p)
        self.most_free, self.is_free, self.face_is_kept = count, False, False

    def decide(self):
        """Solve the next QP with the same matrices, on the face where that is smaller.

        Where that fails, the active rows of the last solved QP are a hint for the other
        form, which has no factor of theirs.
        """
        if self.is_free and self.is_ready and self.k > 0:
            self.on_face = True
            found = solve_dense(self)
            self.on_face, self.face_is_kept = False, found == DONE
            if found != STUCK:
                return found
            self.hints, self.k = self.k, 0
        found = solve_dense(self)
        bounds: Py_ssize_t = 0
        for i in range(self.k):
            bounds += self.active[i] >= self.m
        is_smaller: cython.bint = self.n - bounds + self.p < bounds
        is_plain: cython.bint = self.rho == 0.0 and self.skipped == 0
        self.is_free = found == DONE and is_plain and is_smaller and self.most_free > 0
        self.face_is_kept = False
        return found

    def times_cost(self, x, Px):
        if not self.on_face:
            DenseActiveSet.times_cost(self, x, Px)
            return
        copy(self.load, Px, self.n)
        for i in range(self.free_count):
            j = self.free[i]
            add_scaled(x[j], self.P + j * self.n, Px, self.n)

    def begin(self):
        if not self.on_face:
            return DenseActiveSet.begin(self)
        self.operations, self.base_size = 0.0, 0.0
        for i in range(self.k):
            row = self.active[i]
            if isinf(goal_of(self, row, self.side[row])):
                self.side[row], self.face_is_kept = 0, False
        if not self.face_is_kept and not factor_face(self):
            return False
        set_load(self)
        return True

    def project(self, row):
        if not self.on_face:
            return DenseActiveSet.project(self, row)
        direction, slope, scale = self.direction, self.slope, self.scale[row]
        set_unit_load(self, row, slope)
        set_free_part(self, slope, self.free_part)
        fill(self.held_part, 0.0, self.p + self.held)
        fill(direction, 0.0, self.rows)
        rest = solve_face(self, direction)
        if not rest * scale * scale > self.least_curvature:
            rest = 0.0
            fill(self.free_part, 0.0, self.free_count)
            fill(direction, 0.0, self.rows)
        times_rows(self.G, self.m, self.n, self.n, direction + self.m, direction)
        set_multipliers_of(self, self.ratio)
        return rest

    def append(self, row, side, multiplier, rest):
        if not self.on_face:
            return DenseActiveSet.append(self, row, side, multiplier, rest)
        if row < self.m:
            insert_place(self, self.held, row, side, multiplier)
            self.held += 1
        else:
            insert_place(self, self.k, row, side, multiplier)
            fix(self, row - self.m)
        return factor_held(self)

    def remove(self, i):
        if not self.on_face:
            return DenseActiveSet.remove(self, i)
        j = self.active[i] - self.m
        remove_place(self, i)
        if j < 0:
            self.held -= 1
        elif append_free(self, j):
            add_scaled(-self.s[self.m + j], self.P + j * self.n, self.load, self.n)
        else:
            return False
        return factor_held(self)

    def set_multipliers(self):
        """Set the point on the face, too."""
        if not self.on_face:
            DenseActiveSet.set_multipliers(self)
            return
        set_face_point(self)
        for j in range(self.n):
            self.slope[j] = -self.q[j] - self.load[j]
        set_multipliers_of(self, self.multiplier)

    def set_point_values(self):
        """Set G x, on the face, where `set_multipliers` has set the rest."""
        if not self.on_face:
            DenseActiveSet.set_point_values(self)
            return
        times_rows(self.G, self.m, self.n, self.n, self.s + self.m, self.s)

    def finish(self):
        """On the face: the point as a function of the active rows alone."""
        if not self.on_face:
            return DenseActiveSet.finish(self)
        if self.changed:
            if self.free_count <= MOST_SORTED and not factor_face(self):
                return False
            set_load(self)
            set_face_point(self)
        self.changed = False
        return True


# ---- the face


def factor_face(m):
    """Compute all factors from the sides of the rows, in sorted order."""
    m.k, m.held, m.free_count = 0, 0, 0
    for row in range(m.rows):
        if m.side[row] != 0:
            m.active[m.k] = row
            m.k += 1
            m.held += row < m.m
    for j in range(m.n):
        if m.side[m.m + j] == 0 and not append_free(m, j):
            return False
    return factor_held(m)


def held_row(m, i):
    return m.A + i * m.n if i < m.p else m.G + m.active[i - m.p] * m.n


def set_free_part(m, vector, out):
    for i in range(m.free_count):
        out[i] = vector[m.free[i]]


def append_free(m, j):
    """Append variable j to L, if there is room and P allows it."""
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


def fix(m, j):
    at: Py_ssize_t = 0
    while m.free[at] != j:
        at += 1
    for i in range(at, m.free_count - 1):
        m.free[i] = m.free[i + 1]
    remove_from_triangle(m.free_triangle, m.free_count, at, m.cosines, m.sines)
    m.free_count -= 1
    m.s[m.m + j] = goal_of(m, m.m + j, m.side[m.m + j])
    add_scaled(m.s[m.m + j], m.P + j * m.n, m.load, m.n)


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


def solve_face(m, values):
    """Solve P_FF x + C_F' r = f, C_F x = g: f is in m.free_part, g in m.held_part.

    x and r take their places, and go to values, without G x. Returns the squared length
    of the part of L^-1 f orthogonal to T; 0.0 where it depends on T.
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
    """Set x_F, and r in m.held_part."""
    x = m.s + m.m
    for i in range(m.free_count):
        j = m.free[i]
        m.free_part[i], x[j] = -m.q[j] - m.load[j], 0.0
    for i in range(m.p + m.held):
        goal = m.b[i] if i < m.p else m.h[m.active[i - m.p]]
        m.held_part[i] = goal - dot(held_row(m, i), x, m.n)
    solve_face(m, m.s)
    copy(m.held_part + m.p, m.multiplier, m.held)


def set_multipliers_of(m, multiplier):
    """Set those of the active rows for x_F in m.free_part and r in m.held_part.

    m.slope has what P_F x_F + C'r is subtracted from.
    """
    for i in range(m.free_count):
        add_scaled(-m.free_part[i], m.P + m.free[i] * m.n, m.slope, m.n)
    for i in range(m.p + m.held):
        add_scaled(-m.held_part[i], held_row(m, i), m.slope, m.n)
    copy(m.held_part + m.p, multiplier, m.held)
    for i in range(m.held, m.k):
        multiplier[i] = m.slope[m.active[i] - m.m]
